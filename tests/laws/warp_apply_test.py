#!/usr/bin/env python3
"""`dupin warp fit` and `dupin warp apply`: silhouettes, and one pose on a whole collection.

usage: warp_apply_test.py DUPIN
"""
import re
import unittest

from program import Law, json, math, os
from warp_test import pin, png, read_png, without_times

SIDE = 160


def t_shirt(sleeve=34, drop=22, width=60, hem=8, height=110, left=80, top=24):
    """Corners of a T-shirt about the line x = left."""
    half = [(14, 0), (width / 2, 6), (width / 2 + sleeve, 6 + drop + 10), (width / 2 + sleeve - 12, 6 + drop + 30),
            (width / 2 - 2, 42), (width / 2 + hem, height), (0, height + 4)]
    return [(left + x, top + y) for x, y in half] + [(left - x, top + y) for x, y in reversed(half[:-1])]


def in_polygon(corners, x, y):
    inside = False
    for (x0, y0), (x1, y1) in zip(corners, corners[1:] + corners[:1]):
        if (y0 <= y) != (y1 <= y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            inside = not inside
    return inside


def drawn(corners, side=SIDE):
    """A cut-out with stripes; hard edges."""
    return png([[(60 + 120 * (y // 8 % 2), x, 90, 255) if in_polygon(corners, x + .5, y + .5) else (0, 0, 0, 0)
                 for x in range(side)] for y in range(side)])


def wild(corners=9):
    """A star: no garment."""
    return [(80 + (70 if i % 2 else 25) * math.cos(math.pi * i / corners),
             80 + (70 if i % 2 else 25) * math.sin(math.pi * i / corners)) for i in range(2 * corners)]


PINS = [pin(34, 68, 24, 84, name="left cuff"), pin(126, 68, 136, 84, name="right cuff"),
        pin(56, 52, 56, 52, name="left arm"), pin(104, 52, 104, 52, name="right arm"),
        pin(80, 80, 80, 80, name="chest"), pin(56, 122, 56, 122, name="left hem"),
        pin(104, 122, 104, 122, name="right hem")]


class WarpApplyLaw(Law):
    def setUp(self):
        super().setUp()
        self.write("base.png", drawn(t_shirt()))
        self.write("long.png", drawn(t_shirt(sleeve=40, drop=30)))
        self.write("wide.png", drawn(t_shirt(width=70, hem=2, sleeve=28)))
        self.write("short.png", drawn(t_shirt(height=96, sleeve=30, drop=16)))
        self.write("opaque.png", png([[(9, 9, 9, 255)] * 40] * 40))
        self.write("pins.json", json.dumps(PINS))
        self.done("warp", "new", "base.png", "-o", "pose.dwarp", "--pins", "pins.json", "--density", "900")

    def write(self, name, content):
        with open(self.path(name), "wb") as file:
            file.write(content if isinstance(content, bytes) else content.encode())

    def read(self, *parts):
        with open(self.path(*parts), "rb") as file:
            return file.read()

    def apply(self, status, *arguments):
        found, out, err = self.dupin("warp", "apply", "pose.dwarp", *arguments, "--json")
        self.assertEqual(found, status, err)
        return json.loads(out)

    # ---- apply ------------------------------------------------------------------------------

    def test_one_failure_never_stops_the_rest(self):
        """Two shirts, a picture without transparency, a missing file, a shirt: three rows are good, two have the code
        of what is wrong; each good one has a project and the picture that `warp render` makes of it."""
        images = ["long.png", "opaque.png", "wide.png", "missing.png", "short.png"]
        document = self.apply(1, *images, "-o", "out", "--min-confidence", "0.2")
        self.assertEqual([row["image"] for row in document["rows"]], images)
        self.assertEqual([row["status"] for row in document["rows"]], ["ok", "failed", "ok", "failed", "ok"])
        self.assertEqual((document["ok"], document["doubtful"], document["failed"]), (3, 0, 2))
        self.assertEqual([row["error"]["code"] for row in document["rows"] if row["status"] == "failed"],
                         ["E_NO_ALPHA", "E_NOT_FOUND"])
        self.assertEqual(sorted(os.listdir(self.path("out"))),
                         sorted(["report.json"] + [f"{n}.{e}" for n in ("long", "wide", "short") for e in ("dwarp", "png")]))
        for row in document["rows"]:
            if row["status"] == "failed":
                continue
            self.assertEqual(row["flipped"], 0)
            self.assertGreater(row["stretch"]["min"], 0.2)
            self.assertLess(row["stretch"]["max"], 5)
            self.assertGreater(row["silhouette_overlap"], 0.8)
            self.assertLessEqual(row["silhouette_overlap"], 1)
            self.assertEqual([p["name"] for p in row["pins"]], [p["name"] for p in PINS])
            self.assertEqual(row["least_confidence"], min(p["confidence"] for p in row["pins"]))
            project, picture = (row["outputs"][k]["file"] for k in (0, 1))
            self.done("warp", "render", f"out/{project}", "-o", "again.png")
            self.assertEqual(self.read("again.png"), self.read("out", picture))
        report = json.loads(self.read("out", "report.json"))
        self.assertEqual(report["rows"], document["rows"])

    def test_pins_are_where_a_tailor_would_put_them(self):
        """Cuffs on the sleeves, hems at the hem, left is left: of a shirt drawn by the same rule with other sleeves every
        pin is within 5 % of the height of its true place."""
        row = self.apply(0, "long.png", "-o", "out", "--min-confidence", "0.2")["rows"][0]
        places = {p["name"]: p["source"] for p in row["pins"]}
        self.assertLess(math.dist(places["left hem"], (56, 122)), 6)
        self.assertLess(math.dist(places["right hem"], (104, 122)), 6)
        cuff = lambda s: (80 + s * (30 + 40 - 6 - 10 * .6), 24 + 6 + 30 + 20 - 6)  # noqa: E731
        self.assertLess(math.dist(places["left cuff"], cuff(-1)), 12)
        self.assertLess(math.dist(places["right cuff"], cuff(1)), 12)

    def test_runs_go_on_where_they_stopped(self):
        """What is done from the same inputs is left alone; a changed picture, a damaged output, a changed pose are done
        again, and a failed one always. All bytes are those of one run."""
        images = ["long.png", "wide.png", "short.png"]
        first = self.apply(0, *images, "-o", "out", "--min-confidence", "0.2")
        self.assertEqual(first["reused"], 0)
        files = {name: self.read("out", name) for name in os.listdir(self.path("out")) if name != "report.json"}
        times = {name: os.stat(self.path("out", name)).st_mtime_ns for name in files}
        again = self.apply(0, *images, "-o", "out", "--min-confidence", "0.2")
        self.assertEqual(again["reused"], 3)
        self.assertEqual({name: os.stat(self.path("out", name)).st_mtime_ns for name in files}, times)
        self.write("out/wide.png", b"damaged")
        self.write("short.png", drawn(t_shirt(height=92)))
        third = self.apply(0, *images, "-o", "out", "--min-confidence", "0.2")
        self.assertEqual([row["reused"] for row in third["rows"]], [True, False, False])
        self.assertEqual(self.read("out", "wide.png"), files["wide.png"])
        self.assertNotEqual(self.read("out", "short.png"), files["short.png"])
        self.write("out/report.json", "{ not ours")
        self.assertEqual(self.apply(0, *images, "-o", "out", "--min-confidence", "0.2")["reused"], 0)
        moved = [dict(p, target=[p["target"][0], p["target"][1] + 1]) for p in PINS]
        self.write("pins.json", json.dumps(moved))
        self.done("warp", "new", "base.png", "-o", "pose.dwarp", "--pins", "pins.json", "--density", "900")
        self.assertEqual(self.apply(0, *images, "-o", "out", "--min-confidence", "0.2")["reused"], 0)

    def test_a_stopped_run_leaves_whole_files(self):
        """Whatever --timeout cuts off, the next run finishes, and ends as one run would."""
        images = ["long.png", "wide.png", "short.png"]
        whole = self.apply(0, *images, "-o", "whole", "--min-confidence", "0.2")
        for seconds in ("0.05", "0.2", "0.4"):
            status, _, err = self.dupin("warp", "apply", "pose.dwarp", *images, "-o", "out", "--min-confidence", "0.2",
                                        "--timeout", seconds)
            self.assertIn(status, (0, 6), err)
        done = self.apply(0, *images, "-o", "out", "--min-confidence", "0.2")
        for name in os.listdir(self.path("whole")):
            if name.endswith("png") or name.endswith("dwarp"):
                self.assertEqual(self.read("out", name), self.read("whole", name), name)
        self.assertEqual([r["status"] for r in done["rows"]], [r["status"] for r in whole["rows"]])
        self.assertEqual(sorted(os.listdir(self.path("out"))), sorted(os.listdir(self.path("whole"))))

    def test_jobs_and_threads_do_not_matter(self):
        images = ["long.png", "opaque.png", "wide.png", "short.png"]
        one = self.apply(1, *images, "-o", "out", "--threads", "1", "--report")
        files = {name: self.read("out", name) for name in os.listdir(self.path("out"))}
        for name in files:
            os.remove(self.path("out", name))
        other = self.apply(1, *images, "-o", "out", "--threads", "3", "--jobs", "3", "--report")
        self.assertEqual(without_times(one), without_times(other))
        self.assertEqual({name: self.read("out", name) for name in os.listdir(self.path("out"))}, files)

    def test_absolute_targets_stay(self):
        """A mannequin stands still: targets are those of the template, and the picture is as large as its picture."""
        self.write("large.png", drawn([(1.2 * x, 1.2 * y) for x, y in t_shirt()], 200))
        row = self.apply(0, "large.png", "-o", "out", "--target-rule", "absolute", "--min-confidence", "0.2")["rows"][0]
        self.assertEqual([p["target"] for p in row["pins"]], [p["target"] for p in PINS])
        rows, _ = read_png(self.path("out", "large.png"))
        self.assertEqual((len(rows), len(rows[0])), (SIDE, SIDE))
        self.assertGreater(row["silhouette_overlap"], 0.8)

    def test_doubt_is_an_answer(self):
        """A star is no shirt: it is written, called doubtful, with the reason, and the program says 1."""
        self.write("star.png", drawn(wild()))
        document = self.apply(1, "star.png", "-o", "out")
        self.assertEqual(document["rows"][0]["status"], "doubtful")
        self.assertIn("pins", document["rows"][0]["reasons"])
        self.assertTrue(os.path.exists(self.path("out", "star.png")))

    def test_the_page_stands_alone(self):
        self.apply(1, "long.png", "opaque.png", "-o", "out", "--report")
        page = self.read("out", "report.html").decode()
        sources = re.findall(r'(?:src|href)="([^"]*)"', page)
        self.assertTrue(sources)
        self.assertTrue(all(s.startswith(("data:image/png;base64,", "#")) for s in sources), sources)
        self.assertIn("E_NO_ALPHA", page)
        self.assertIn("opaque.png", page)
        self.assertEqual(page.count("data:image/png"), 1)

    def test_usage(self):
        os.mkdir(self.path("more"))
        self.write("more/long.png", drawn(t_shirt()))
        for arguments, code in ((("long.png", "more/long.png", "-o", "out"), 2), (("long.png", "-o", "."), 2),
                                (("long.png", "-o", "out", "--jobs", "0"), 2), (("long.png", "-o", "long.png/x"), 7),
                                (("long.png", "-o", "out", "--target-rule", "near"), 2)):
            status, out, err = self.dupin("warp", "apply", "pose.dwarp", *arguments)
            self.assertEqual((status, out), (code, b""), (arguments, err))
        self.assertEqual(self.dupin("warp", "apply", "none.dwarp", "long.png", "-o", "out")[0], 3)
        self.assertFalse(os.path.exists(self.path("out")))

    def test_inputs_are_never_written(self):
        """The template's own picture, and projects and pictures called as the reports are, stay."""
        os.mkdir(self.path("other"))
        self.write("other/base.png", drawn(t_shirt(width=66)))
        before = self.read("base.png")
        self.apply(2, "other/base.png", "-o", ".")
        self.assertEqual(self.read("base.png"), before)
        os.mkdir(self.path("out"))
        self.done("warp", "new", "base.png", "-o", "pose2.dwarp", "--pins", "pins.json")
        os.rename(self.path("pose2.dwarp"), self.path("out", "report.json"))
        kept = self.read("out", "report.json")
        status, _, err = self.dupin("warp", "apply", "out/report.json", "long.png", "-o", "out")
        self.assertEqual(status, 2, err)
        self.assertEqual(self.read("out", "report.json"), kept)
        self.apply(2, "long.png", "-o", "")
        self.apply(2, "long.png", "-o", "-")

    def test_rows_that_were_touched_are_made_anew(self):
        """A report whose rows are no longer what was written is no answer, whatever is wrong with it."""
        whole = self.apply(0, "long.png", "-o", "out", "--min-confidence", "0.2", "--report")
        for key, value in (("stretch", None), ("reasons", 5), ("status", 7), ("match_confidence", "x"), ("outputs", [])):
            report = json.loads(self.read("out", "report.json"))
            report["rows"][0][key] = value
            self.write("out/report.json", json.dumps(report))
            again = self.apply(0, "long.png", "-o", "out", "--min-confidence", "0.2", "--report")
            self.assertEqual(again["reused"], 0, key)
            self.assertEqual(without_times(again), without_times(whole), key)

    def test_a_project_changed_by_hand_is_kept(self):
        self.apply(0, "long.png", "-o", "out", "--min-confidence", "0.2")
        project = json.loads(self.read("out", "long.dwarp"))
        del project["checksum"]
        project["stages"][0]["pins"][0]["target"][0] += 3
        self.write("out/long.dwarp", json.dumps(project))
        kept = self.read("out", "long.dwarp")
        row = self.apply(1, "long.png", "-o", "out", "--min-confidence", "0.2")["rows"][0]
        self.assertEqual((row["status"], row["error"]["code"]), ("failed", "E_OUTPUT_CHANGED"))
        self.assertEqual(row["stale"], ["long.dwarp", "long.png"])
        self.assertEqual(self.read("out", "long.dwarp"), kept)
        os.remove(self.path("out", "long.dwarp"))
        self.assertEqual(self.apply(0, "long.png", "-o", "out", "--min-confidence", "0.2")["reused"], 0)

    def test_projects_name_the_picture_they_were_made_of(self):
        """The same bytes from another folder are no reason to leave a project that names the first one."""
        for folder in ("a", "b"):
            os.mkdir(self.path(folder))
            self.write(folder + "/long.png", self.read("long.png"))
        self.apply(0, "a/long.png", "-o", "out", "--min-confidence", "0.2")
        self.apply(0, "b/long.png", "-o", "out", "--min-confidence", "0.2")
        self.assertEqual(json.loads(self.read("out", "long.dwarp"))["image"]["path"], "../b/long.png")

    def test_what_leaves_the_picture_is_told(self):
        far = [dict(p, target=[p["target"][0] + 60, p["target"][1]]) for p in PINS]
        self.write("pins.json", json.dumps(far))
        self.done("warp", "new", "base.png", "-o", "pose.dwarp", "--pins", "pins.json", "--density", "900")
        row = self.apply(1, "long.png", "-o", "out", "--min-confidence", "0.2")["rows"][0]
        self.assertEqual((row["status"], row["reasons"]), ("doubtful", ["cut off"]))
        self.assertEqual([w["code"] for w in row["warnings"]], ["W_CUT_OFF"])
        rendered = json.loads(self.done("warp", "render", "pose.dwarp", "-o", "far.png", "--json"))
        self.assertEqual([w["code"] for w in rendered["warnings"]], ["W_CUT_OFF"])

    def test_pins_of_the_wrong_kind_are_told(self):
        project = json.loads(self.read("pose.dwarp"))
        del project["checksum"]
        for p in project["stages"][0]["pins"]:
            p["kind"] = "exterior"
        self.write("pose.dwarp", json.dumps(project))
        row = self.apply(0, "long.png", "-o", "out", "--min-confidence", "0.2")["rows"][0]
        self.assertEqual([w["code"] for w in row["warnings"]], ["W_PIN_IGNORED"])

    def test_a_fit_in_another_folder_finds_its_picture(self):
        os.mkdir(self.path("fits"))
        self.done("warp", "fit", "pose.dwarp", "--silhouette", "long.png", "-o", "fits/f.dwarp", "--min-overlap", "0.5",
                  "--min-confidence", "0")
        self.done("warp", "render", "fits/f.dwarp", "-o", "fits/f.png")

    # ---- fit --------------------------------------------------------------------------------

    def test_a_shirt_fills_the_silhouette_of_another(self):
        """0.985 of the union is asked for by the program's own measure, with its margin of 2 px; the picture that is
        rendered, counted pixel by pixel without any of that, fills 0.96 of a silhouette with hard edges."""
        for start in ("base.png", "pose.dwarp"):
            project = start if start.endswith("dwarp") else "plain.dwarp"
            if project == "plain.dwarp":
                self.done("warp", "new", "base.png", "-o", project)
            out = self.done("warp", "fit", project, "--silhouette", "wide.png", "-o", "fitted.dwarp", "--json")
            document = json.loads(out)
            self.assertTrue(document["accepted"])
            self.assertLess(document["iou_before"], document["iou_after"] - 0.02)
            self.assertGreaterEqual(document["iou_after"], 0.985)
            self.assertEqual(document["flipped"], 0)
            self.assertGreater(len(document["pins"]), 8)
            self.assertTrue(all(0 <= p["confidence"] <= 1 for p in document["pins"]))
            stages = json.loads(self.read("fitted.dwarp"))["stages"]
            self.assertEqual(stages[-1]["mode"], "fine")
            self.assertEqual(len(stages[-1]["pins"]), len(document["pins"]))
            self.assertEqual(len(stages), 1 if project == "plain.dwarp" else 2)
            self.done("warp", "render", "fitted.dwarp", "-o", "worn.png")
            ours, target = (read_png(self.path(n))[0] for n in ("worn.png", "wide.png"))
            pairs = [(p[3] > 127, q[3] > 127) for a, b in zip(ours, target) for p, q in zip(a, b)]
            both, either = sum(p and q for p, q in pairs), sum(p or q for p, q in pairs)
            self.assertGreater(both / either, 0.96)

    def test_a_poor_match_is_written_and_said(self):
        self.write("star.png", drawn(wild()))
        status, out, err = self.dupin("warp", "fit", "pose.dwarp", "--silhouette", "star.png", "-o", "q.dwarp", "--json")
        self.assertEqual(status, 1, err)
        self.assertFalse(json.loads(out)["accepted"])
        self.done("warp", "render", "q.dwarp", "-o", "q.png")

    def test_fit_refuses(self):
        for arguments, code in ((("--silhouette", "opaque.png", "-o", "q.dwarp"), 5),
                                (("--silhouette", "none.png", "-o", "q.dwarp"), 3),
                                (("--silhouette", "wide.png", "-o", "q.png"), 2),
                                (("--silhouette", "wide.png", "-o", "pose.dwarp"), 2),
                                (("--silhouette", "wide.png", "-o", "q.dwarp", "--tolerance", "0"), 2)):
            status, out, err = self.dupin("warp", "fit", "pose.dwarp", *arguments)
            self.assertEqual((status, out), (code, b""), (arguments, err))
        self.assertFalse(os.path.exists(self.path("q.dwarp")))


if __name__ == "__main__":
    unittest.main()
