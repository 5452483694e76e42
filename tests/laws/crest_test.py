#!/usr/bin/env python3
"""`dupin crest` and its lines in pictures as users meet them: fields, files, units, thresholds, refusals.

usage: crest_test.py DUPIN
"""
import base64
import re
import unittest

from program import Law, json, math, os, read_ply, write_ply

LINE = ["kind", "points", "length", "strength", "mean_scale", "closed", "sharpness", "mean_level", "scale_peaks",
        "strength_sd", "sharpness_sd", "position_sd", "snr"]
BARS = LINE[-4:]


def read_ascii_ply(path):
    """Rows of every element of an ascii PLY, as dictionaries."""
    with open(path, encoding="ascii") as file:
        lines = file.read().splitlines()
    end = lines.index("end_header")
    elements = []
    for words in (line.split() for line in lines[:end]):
        if words[0] == "element":
            elements.append((words[1], int(words[2]), []))
        if words[0] == "property":
            elements[-1][2].append(words[2])
    found, at = {}, end + 1
    for name, count, properties in elements:
        found[name] = [dict(zip(properties, map(float, line.split()))) for line in lines[at:at + count]]
        at += count
    assert at == len(lines)
    return found


class Crest(Law):
    def setUp(self):
        super().setUp()
        self.synth("e.ply", "--shape", "ellipsoid", "--vertices", "3000")

    def crest(self, name, *words, status=0):
        code, out, err = self.dupin("crest", name, *words, "--json", "--quiet")
        self.assertEqual(code, status, (words, err))
        return json.loads(out)

    def test_the_answer_has_the_fields_that_are_promised(self):
        plain = self.crest("e.ply")
        self.assertEqual(list(plain), ["mean_edge_length", "tau", "noise_sigma", "lines", "warnings"])
        self.assertGreaterEqual(len(plain["lines"]), 1)
        for line in plain["lines"]:
            self.assertEqual(list(line), LINE)
            self.assertIn(line["kind"], ("ridge", "valley"))
            self.assertEqual([line[bar] for bar in BARS], [None] * 4)
        sure = self.crest("e.ply", "--noise", "0.001", "--replicas", "4")
        self.assertEqual(sure["noise_sigma"], 0.001)
        for line in sure["lines"]:
            for bar in BARS:
                self.assertGreater(line[bar], 0.0)
        for line in self.crest("e.ply", "--noise", "0")["lines"]:
            self.assertEqual([line[bar] for bar in BARS], [0.0, 0.0, 0.0, None])

    def test_files_hold_the_lines_that_the_answer_counts(self):
        answer = self.crest("e.ply", "-o", "l.ply")
        self.crest("e.ply", "-o", "l.obj")
        counts = [line["points"] for line in answer["lines"]]
        ply = read_ascii_ply(self.path("l.ply"))
        self.assertEqual(len(ply["vertex"]), sum(counts))
        self.assertEqual(len(ply["edge"]), sum(n - 1 for n in counts))
        for i, line in enumerate(answer["lines"]):
            points = [v for v in ply["vertex"] if v["line"] == i]
            self.assertEqual({v["kind"] for v in points}, {0.0 if line["kind"] == "ridge" else 1.0})
            length = sum(math.dist([a[x] for x in "xyz"], [b[x] for x in "xyz"]) for a, b in zip(points, points[1:]))
            self.assertAlmostEqual(length, line["length"], delta=1e-9 * length)
            self.assertTrue(all(v["scale"] > 0 and v["strength"] > 0 and v["sd"] == -1 for v in points))
        with open(self.path("l.obj"), encoding="ascii") as file:
            rows = [row.split() for row in file]
        vertices = [list(map(float, row[1:])) for row in rows if row[0] == "v"]
        self.assertEqual(vertices, [[v[x] for x in "xyz"] for v in ply["vertex"]])
        lines = [list(map(int, row[1:])) for row in rows if row[0] == "l"]
        self.assertEqual([len(line) for line in lines], counts)
        self.assertEqual([i for line in lines for i in line], list(range(1, sum(counts) + 1)))

    def test_the_unit_of_length_scales_lengths_and_nothing_else(self):
        points, faces = read_ply(self.path("e.ply"))
        write_ply(self.path("big.ply"), [tuple(1024 * x for x in p) for p in points], faces)
        plain, big = self.crest("e.ply"), self.crest("big.ply")
        self.assertEqual(len(plain["lines"]), len(big["lines"]))
        for a, b in zip(plain["lines"], big["lines"]):
            for name in ("length", "mean_scale"):
                self.assertAlmostEqual(1024 * a[name], b[name], delta=1e-6 * b[name])
            for name in ("strength", "sharpness", "mean_level"):
                self.assertAlmostEqual(a[name], b[name], delta=1e-6 * b[name])

    def test_thresholds_keep_the_lines_above_them(self):
        self.synth("b.ply", "--shape", "bumpy-sphere", "--vertices", "4000")
        words = ("--noise", "auto", "--replicas", "4")
        everything = self.crest("b.ply", *words)["lines"]
        self.assertGreaterEqual(len(everything), 3)
        least = sorted(line["snr"] for line in everything)[len(everything) // 2]
        kept = self.crest("b.ply", *words, "--min-snr", repr(least))["lines"]
        self.assertEqual(kept, [line for line in everything if line["snr"] >= least])
        self.assertEqual(self.crest("b.ply", *words, "--top", "2")["lines"], everything[:2])
        for line in self.crest("b.ply", "--min-sharpness", "1")["lines"]:
            self.assertGreaterEqual(line["sharpness"], 1)

    def test_surfaces_without_lines_have_none(self):
        for shape in ("sphere", "plane", "cylinder"):
            self.synth("s.ply", "--shape", shape, "--vertices", "3000")
            self.assertEqual(self.crest("s.ply", "-o", "s.obj")["lines"], [])
            self.assertEqual(read_text(self.path("s.obj")), "# crest lines\n")

    def test_clouds_are_refused_and_nothing_is_written(self):
        with open(self.path("c.xyz"), "w", encoding="ascii") as out:
            for i in range(100):
                out.write(f"{math.cos(i)} {math.sin(i)} {i * 0.1}\n")
        answer = self.crest("c.xyz", "-o", "c.ply", status=5)
        self.assertEqual(answer["error"]["code"], "E_NO_FACES")
        self.assertFalse(os.path.exists(self.path("c.ply")))

    def test_lines_are_drawn_from_both_files(self):
        pictures = {}
        for name in ("l.ply", "l.obj"):
            self.crest("e.ply", "-o", name)
            answer = json.loads(self.done("render", "e.ply", "--lines", name, "-o", "p.png", "--size", "320x240",
                                          "--json", "--quiet"))
            self.assertGreaterEqual(answer["lines"], 1)
            with open(self.path("p.png"), "rb") as file:
                pictures[name] = file.read()
        self.done("render", "e.ply", "-o", "p.png", "--size", "320x240")
        with open(self.path("p.png"), "rb") as file:
            self.assertNotIn(file.read(), pictures.values())

    def test_pages_have_two_pictures_of_every_surface_and_a_row_a_line(self):
        answer = self.crest("e.ply", "--report", "page.html", "--replicas", "4", "--add-noise", "20,50")
        for line in answer["lines"]:  # a page is of error bars too
            self.assertGreater(line["snr"], 0.0)
        with open(self.path("page.html"), encoding="utf-8") as file:
            page = file.read()
        shown = re.findall(r'<img src="([^"]+)"', page)
        self.assertEqual(len(shown), 6)
        self.assertEqual(len(set(shown)), 6)
        for source in shown:
            kind, data = source.split(",")
            self.assertEqual(kind, "data:image/png;base64")
            self.assertEqual(base64.b64decode(data)[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual([name for name in os.listdir(self.folder) if name.endswith(".png")], [])
        self.assertEqual(re.findall(r"<h2[^>]*>([^<]*)</h2>", page), ["As it is", "With 20 % noise", "With 50 % noise"])
        first = page[page.index("<tbody>"):page.index("</tbody>")]
        self.assertEqual(first.count("<tr>"), len(answer["lines"]))
        for line in answer["lines"]:
            self.assertIn(f'>{line["length"]:.4g}<', first)
            self.assertIn(f'>{line["snr"]:.1f}<', first)
        self.assertEqual(self.crest("e.ply", "--replicas", "4", "--noise", "auto")["lines"], answer["lines"])
        self.crest("e.ply", "--report", "-", status=2)
        self.crest("e.ply", "--report", "page.png", status=2)
        self.crest("e.ply", "--report", "page.html", "--view", "beside", status=2)

    def test_what_cannot_be_written_or_means_nothing_is_refused_first(self):
        for words, expected in (
            (["--add-noise", "20"], 2),
            (["--report", "nowhere/page.html"], 7),
            (["-o", "nowhere/lines.obj"], 7),
        ):
            status, _, err = self.dupin("crest", "e.ply", *words)
            self.assertEqual(status, expected, (words, err))

    def test_damaged_line_files_are_refused(self):
        self.crest("e.ply", "-o", "l.ply")
        text = read_text(self.path("l.ply"))
        head = text.index("end_header")
        for damage in (text[:len(text) // 2], text[:head], text.replace("ascii", "binary_little_endian"),
                       text[:text.rindex("\n", 0, -1)] + "\n999999 0 0 1 1 1\n",
                       text.replace("property double x", "property list uchar int x"),
                       text[:head + 11] + "nan" + text[head + 12:]):
            with open(self.path("bad.ply"), "w", encoding="ascii") as out:
                out.write(damage)
            status, _, err = self.dupin("render", "e.ply", "--lines", "bad.ply", "-o", "p.png", "--size", "64x64")
            self.assertEqual(status, 4, err)
            self.assertIn(b"bad.ply", err)
            self.assertFalse(os.path.exists(self.path("p.png")))


def read_text(path):
    with open(path, encoding="ascii") as file:
        return file.read()


if __name__ == "__main__":
    unittest.main()
