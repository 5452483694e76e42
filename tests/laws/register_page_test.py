#!/usr/bin/env python3
"""`dupin register --report`, `--preset thesis` and `dupin register-all --report`: pages that say what the JSON says.

usage: register_page_test.py DUPIN
"""
import base64
import html.parser
import re
import struct
import unittest
import zlib

from program import Law, become_nobody, json, math, os, read_ply, write_ply


class Page(html.parser.HTMLParser):
    """Text, tables, pictures and plots of a page; whatever is opened is closed."""

    def __init__(self, text):
        super().__init__()
        self.pictures, self.tables, self.open, self.texts = [], [], [], []
        self.num_svg = self.num_paths = 0
        self.links = []
        self.feed(text)
        assert not self.open, self.open

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag not in ("meta", "img", "path", "rect", "br"):
            self.open.append(tag)
        if tag == "img":
            self.pictures.append(attributes)
        if tag == "table":
            self.tables.append([])
        if tag == "tr" and self.tables:
            self.tables[-1].append([])
        if tag in ("td", "th"):
            self.tables[-1][-1].append("")
        if tag == "svg":
            self.num_svg += 1
        if tag == "path":
            self.num_paths += 1
        self.links += [attributes[name] for name in ("href", "src") if name in attributes]

    def handle_startendtag(self, tag, attributes):
        self.num_paths += tag == "path"

    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag, tag

    def handle_data(self, data):
        self.texts.append(data)
        if self.open and self.open[-1] in ("td", "th"):
            self.tables[-1][-1][-1] += data

    @property
    def text(self):
        return " ".join(" ".join(self.texts).split())

    def table(self, head):
        return next(table for table in self.tables if table[0][0] == head)


def pixels(png):
    """Rows of bytes of an RGB or RGBA picture, unfiltered by filter 0 to 4."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    at, data = 8, b""
    while at < len(png):
        size, kind = struct.unpack_from(">I4s", png, at)
        body = png[at + 8:at + 8 + size]
        assert struct.unpack_from(">I", png, at + 8 + size)[0] == zlib.crc32(kind + body), kind
        if kind == b"IHDR":
            width, height, depth, color = struct.unpack_from(">IIBB", body)
            assert depth == 8 and color in (2, 6)
        if kind == b"IDAT":
            data += body
        at += 12 + size
    raw = zlib.decompress(data)
    step = 3 if color == 2 else 4
    assert len(raw) == height * (1 + width * step)
    return width, height, raw


NUMBER = "%.6g"


class Pages(Law):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.ready = {}

    def setUp(self):
        """Three views of a bumpy body, 40 degrees apart, in poses of their own, and a ball."""
        super().setUp()
        self.synth("b.ply", "--shape", "bumpy-sphere", "--vertices", "6000", "--seed", "5")
        self.synth("ball.ply", "--shape", "sphere", "--vertices", "2000")
        self.done("synth", "views", "b.ply", "-o", "v", "--count", "3", "--step", "40", "--shuffle", "--rows", "70",
                  "--cols", "70", "--seed", "2")
        self.files = ["v/view_000.ply", "v/view_001.ply", "v/view_002.ply"]

    def run_json(self, *words, status=0):
        code, out, err = self.dupin(*words, "--json", "--quiet")
        self.assertEqual(code, status, (words, out[:2000], err))
        return json.loads(out)

    def page(self, name):
        with open(self.path(name), encoding="utf-8") as file:
            text = file.read()
        page = Page(text)
        # Nothing is asked of anybody else.
        for link in page.links:
            self.assertTrue(link.startswith(("#", "data:image/png;base64,")), link[:60])
        return page, text

    def check_pictures(self, page, count):
        self.assertEqual(len(page.pictures), count)
        for picture in page.pictures:
            width, height, raw = pixels(base64.b64decode(picture["src"].split(",", 1)[1], validate=True))
            self.assertEqual((str(width), str(height)), (picture["width"], picture["height"]))
            # White paper alone would pack to nothing and hold few values.
            self.assertGreater(len(set(raw)), 50, picture["alt"])
            self.assertTrue(picture["alt"])
        self.assertEqual(len({picture["src"] for picture in page.pictures}), count)

    def check_figures(self, page, answer):
        told = {row[0]: row[1] for row in page.table("figure")[1:]}
        self.assertEqual(told["accepted"], str(answer["accepted"]).lower())
        for name in ("scale", "overlap", "overlap_fixed", "conflict", "rmse", "confidence", "rotation_sd",
                     "translation_sd", "scale_sd"):
            value = answer[name]
            self.assertEqual(told[name], "not known" if value is None else NUMBER % value, name)
        self.assertEqual(told["inliers"], str(answer["inliers"]))
        self.assertEqual(told["correspondences"], str(len(answer["correspondences"])))
        self.assertEqual(told["translation"], " ".join(NUMBER % x for x in answer["translation"]))
        trace = sum(answer["rotation"][k][k] for k in range(3))
        angle = math.degrees(math.acos(max(-1.0, min(1.0, (trace - 1.0) / 2.0))))
        self.assertAlmostEqual(float(told["rotation"]), angle, delta=1e-3)

    def test_the_page_says_what_the_json_says(self):
        files = self.files[:2]
        answer = self.run_json("register", *files, "--scale", "fixed", "--report", "p.html")
        self.assertTrue(answer["accepted"])
        page, text = self.page("p.html")
        self.check_pictures(page, 7)  # two before, two after, the matches, the distances of both
        self.check_figures(page, answer)
        self.assertEqual(page.num_svg, 1)
        self.assertGreaterEqual(page.num_paths, 6)
        self.assertIn(f"{len(answer['correspondences'])} matches that agree", page.text)
        self.assertIn("was brought onto", page.text)
        for file in files:
            self.assertIn(file, page.text)
        # The matrix of the page is that of the JSON, to the digits it has.
        block = re.search(r"<pre>([^<]*)\n([^<]*)\n([^<]*)\n</pre>", text).groups()
        for row, line in zip(answer["transform"], block):
            for value, word in zip(row, line.split()):
                self.assertAlmostEqual(float(word), value, delta=1e-7 * max(1.0, abs(value)))
        # The same again, on another number of threads, gives the same bytes.
        self.run_json("register", *files, "--scale", "fixed", "--report", "p.html", "--threads", "1")
        self.assertEqual(self.page("p.html")[1], text)
        # And no temporary is left.
        self.assertEqual([name for name in os.listdir(self.folder) if name.startswith(".")], [])

    def test_a_refusal_is_told_and_its_candidate_drawn(self):
        """A ball turns on a ball: the sentence of the terminal is on the page."""
        answer = self.run_json("register", "ball.ply", "ball.ply", "--scale", "fixed", "--report", "p.html", status=1)
        self.assertFalse(answer["accepted"])
        page, _ = self.page("p.html")
        self.check_figures(page, answer)
        self.assertEqual(len(page.pictures), 7)
        _, said, _ = self.dupin("register", "ball.ply", "ball.ply", "--scale", "fixed", "--quiet")
        sentence = said.decode().splitlines()[0].split(": ", 1)[1]
        self.assertIn(sentence, page.text)
        self.assertIn("was not brought onto", page.text)
        self.assertIn("refused", page.text)

    def test_bare_points_on_a_surface_and_the_other_way(self):
        """A cloud in another unit, far away, on either side: the page is as whole."""
        points, _ = read_ply(self.path(self.files[0]))
        with open(self.path("c.xyz"), "w", encoding="ascii") as out:
            out.writelines("%r %r %r\n" % tuple(25.4 * x + 1000.0 for x in p) for p in points[::2])
        for pair in (["c.xyz", self.files[1]], [self.files[1], "c.xyz"]):
            code, out, err = self.dupin("register", *pair, "--report", "p.html", "--json", "--quiet")
            self.assertIn(code, (0, 1), err)
            page, _ = self.page("p.html")
            self.check_pictures(page, 7)
            self.check_figures(page, json.loads(out))
            self.assertIn("side by side", page.text)

    def test_other_poses_are_listed(self):
        points, faces = [], []
        rings, around = 40, 80
        for i in range(rings + 1):
            for j in range(around):
                t, u = math.pi * i / rings, 2 * math.pi * j / around
                points.append((1.8 * math.sin(t) * math.cos(u), 1.35 * math.sin(t) * math.sin(u), math.cos(t)))
        for i in range(rings):
            for j in range(around):
                a, b = i * around + j, i * around + (j + 1) % around
                faces += [(a, a + around, b), (b, a + around, b + around)]
        write_ply(self.path("e.ply"), points, faces)
        answer = self.run_json("register", "e.ply", "e.ply", "--scale", "fixed", "--report", "p.html")
        self.assertGreater(answer["alternatives"], 0)
        page, _ = self.page("p.html")
        table = page.table("pose")
        self.assertEqual(len(table), 2 + answer["alternatives"])
        for row in table[2:]:
            self.assertAlmostEqual(float(row[1]), 180.0, delta=3.0)  # half turns about the axes

    def test_names_cannot_write_into_the_page(self):
        name = "<script>alert(1)</script>&.ply"
        os.mkdir(self.path("<script>alert(1)<"))
        os.rename(self.path(self.files[0]), self.path(name))
        self.run_json("register", name, self.files[1], "--report", "p.html")
        page, text = self.page("p.html")
        self.assertNotIn("<script>alert", text)
        self.assertIn(name, page.text)

    def test_a_page_that_cannot_be_written_is_refused_before_the_work(self):
        """Work would be missed: the inputs do not even exist."""
        os.mkdir(self.path("d.html"))
        for verb in ("register", "register-all"):
            scans = ["missing.ply", "missing2.ply"]
            for page in ("d.html", "nowhere/p.html"):
                error = self.run_json(verb, *scans, "--report", page, status=7)["error"]
                self.assertEqual(error["code"], "E_WRITE")
            self.run_json(verb, *scans, "--report", "p.txt", status=2)
            self.run_json(verb, *scans, "--report", "-", status=2)
            self.run_json(verb, *scans, "-o", "nowhere/a.ply", status=7)
            self.run_json(verb, *scans, "--report", "p.html", status=3)
        self.assertFalse(os.path.exists(self.path("p.html")))
        closed = self.path("closed")
        os.mkdir(closed)
        os.chmod(closed, 0o555)
        code, out, _ = self.dupin("register", "missing.ply", "missing2.ply", "--report", "closed/p.html", "--json",
                                  program=self.open_program(), preexec_fn=become_nobody)
        self.assertEqual((code, json.loads(out)["error"]["code"]), (7, "E_WRITE"))

    def test_all_scans_in_one_frame(self):
        answer = self.run_json("register-all", *self.files, "ball.ply", "--report", "p.html", status=1)
        page, text = self.page("p.html")
        self.check_pictures(page, 3)
        self.assertEqual(answer["unregistered"], ["ball.ply"])
        self.assertIn("No place was found for: ball.ply.", page.text)
        pairs = page.table("moving")
        self.assertEqual(len(pairs), 1 + 6)
        told = {(row[0], row[1]): row for row in pairs[1:]}
        for pair in answer["pairs"]:
            row = told.pop((pair["moving"], pair["fixed"]))
            self.assertEqual(row[2:4], ["accepted", "used" if pair["used"] else "dropped"])
            self.assertEqual(row[4], NUMBER % pair["overlap"])
            self.assertEqual(row[6:9], [NUMBER % pair[name] for name in ("confidence", "loop_turn", "loop_shift")])
        for row in told.values():
            self.assertNotEqual(row[2], "accepted")
            self.assertEqual(row[4:], ["-"] * 5)
        places = {row[0]: row[2] for row in page.table("scan")[1:]}
        self.assertEqual(places["ball.ply"], "left out")
        self.assertEqual(sorted(places.values()), ["left out", "registered", "registered", "the frame"])
        self.run_json("register-all", *self.files, "ball.ply", "--report", "p.html", status=1)
        self.assertEqual(self.page("p.html")[1], text)

    def test_the_preset_of_the_thesis(self):
        """A surface on itself, moved: the features meet, and what they cannot know is null."""
        points, faces = read_ply(self.path("b.ply"))
        c, s = math.cos(0.5), math.sin(0.5)
        # Bumps of many sizes: equal round ones have neither frames nor words.
        waves = [(1.0 + 0.12 * math.sin(7 * x + 2) * math.sin(5 * y + 1) + 0.1 * math.sin(9 * z + 4 * x)) for x, y, z in points]
        points = [(1.3 * w * x, 1.1 * w * y, w * z) for w, (x, y, z) in zip(waves, points)]
        write_ply(self.path("there.ply"), points, faces)
        write_ply(self.path("here.ply"), [(c * x - s * y + 3.0, s * x + c * y, z) for x, y, z in points], faces)
        names = ["here.ply", "there.ply", "--preset", "thesis"]
        raw = self.run_json("register", *names, "--refine", "none", "-o", "raw.ply")
        product = self.run_json("register", "here.ply", "there.ply")
        self.assertEqual(list(raw), list(product))
        self.assertTrue(raw["accepted"])
        self.assertEqual((raw["scale"], raw["refusal"]), (1.0, "none"))
        for name in ("conflict", "confidence", "rotation_sd", "translation_sd", "scale_sd", "alternatives"):
            self.assertIsNone(raw[name], name)
        # A copy: the three points that give the pose are the same vertices, so it is exact.
        truth = [[c, s, 0.0, -3.0 * c], [-s, c, 0.0, 3.0 * s], [0.0, 0.0, 1.0, 0.0]]
        for row, line in zip(raw["transform"], truth):
            for value, true in zip(row, line):
                self.assertAlmostEqual(value, true, delta=1e-6)
        self.assertEqual(raw["inliers"], len(raw["correspondences"]))
        self.assertTrue(all(a == b for a, b in raw["correspondences"]))
        self.assertEqual((raw["overlap"], raw["overlap_fixed"]), (1.0, 1.0))
        self.assertLess(raw["rmse"], 1e-6)
        # Refined, the features keep their say. The patches of both scans lie on other grids and do not follow every
        # wave: they agree within a tenth of the mean edge, .05.
        fine = self.run_json("register", *names, "--report", "p.html")
        self.assertEqual([fine[k] for k in ("accepted", "overlap", "rmse", "correspondences")],
                         [raw[k] for k in ("accepted", "overlap", "rmse", "correspondences")])
        for row, line in zip(fine["transform"], truth):
            for value, true in zip(row, line):
                self.assertAlmostEqual(value, true, delta=5e-3)
        self.assertNotEqual(fine["transform"], raw["transform"])
        page, _ = self.page("p.html")
        self.check_pictures(page, 7)
        self.check_figures(page, fine)
        # The same limits and codes as without the preset.
        turn = self.run_json("register", *names, "--max-rotation", "5", status=1)
        self.assertEqual(turn["refusal"], "rotation")
        self.run_json("register", *names, "--min-confidence", "0.5", status=2)
        self.run_json("register", *names, "--scale", "estimate", status=2)
        self.run_json("register", *names, "--scale", "fixed", "--refine", "none")
        self.run_json("register", "here.ply", "there.ply", "--preset", "other", status=2)

    def test_the_thesis_has_no_pose_without_features(self):
        answer = self.run_json("register", "ball.ply", self.files[0], "--preset", "thesis", "-o", "a.ply", "--report",
                               "p.html", status=1)
        self.assertEqual((answer["accepted"], answer["refusal"]), (False, "no_features"))
        for name in ("transform", "scale", "rotation", "translation", "overlap", "rmse"):
            self.assertIsNone(answer[name], name)
        self.assertFalse(os.path.exists(self.path("a.ply")))
        page, _ = self.page("p.html")
        self.check_pictures(page, 2)
        self.assertIn("fewer than three features", page.text)


if __name__ == "__main__":
    unittest.main()
