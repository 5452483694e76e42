#!/usr/bin/env python3
"""`dupin synth surface` and `dupin check` as users meet them.

usage: check_cli_test.py DUPIN
"""
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

DUPIN = os.path.abspath(sys.argv.pop(1))


def dupin(folder, *arguments):
    process = subprocess.run([DUPIN, *arguments], cwd=folder, capture_output=True, text=True,
                             timeout=60)
    return process.returncode, process.stdout, process.stderr


class CheckAndSynth(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.folder = self.temporary.name

    def synth(self, name, *options):
        code, out, err = dupin(self.folder, "synth", "surface", "--json", "-o", name, *options)
        self.assertEqual(code, 0, err)
        return json.loads(out)

    def test_a_made_sphere_is_judged_a_sphere(self):
        made = self.synth("s.ply", "--shape", "sphere", "--vertices", "4000")
        code, out, _ = dupin(self.folder, "check", "--json", "s.ply")
        self.assertEqual(code, 0)
        found = json.loads(out)
        self.assertEqual((found["vertices"], found["faces"]), (made["vertices"], made["faces"]))
        self.assertEqual((found["euler"], found["components"], found["boundary_loops"]), (2, 1, 0))
        self.assertTrue(found["manifold"] and found["oriented"])
        self.assertEqual(found["warnings"], [])
        # inscribed facets of edge h miss the volume by less than h^2
        slack = 4 * math.pi / 3 * found["mean_edge_length"] ** 2
        self.assertLess(abs(found["volume"] - 4 * math.pi / 3), slack)
        self.assertAlmostEqual(found["mean_edge_length"], made["mean_edge_length"], delta=1e-12)

    def test_every_shape_is_a_sound_surface(self):
        _, out, _ = dupin(self.folder, "synth", "surface", "--help")
        shapes = out[out.index("{") + 1:out.index("}")].split(",")
        self.assertGreater(len(shapes), 8)
        for shape in shapes:
            self.synth("x.obj", "--shape", shape, "--vertices", "900", "--noise", "10")
            code, out, _ = dupin(self.folder, "check", "--json", "x.obj")
            found = json.loads(out)
            self.assertEqual(code, 0, shape)
            self.assertTrue(found["manifold"] and found["oriented"], shape)
            self.assertEqual(found["warnings"], [], shape)
            self.assertEqual(found["volume"] is None, found["boundary_loops"] > 0, shape)

    def test_noise_has_a_seed(self):
        options = ["--noise", "20", "--noise-model", "isotropic", "--seed"]
        made = self.synth("a.ply", *options, "1")
        self.assertAlmostEqual(made["noise_sigma"], 0.2 * made["mean_edge_length"], delta=1e-15)
        self.synth("b.ply", *options, "1")
        self.synth("c.ply", *options, "2")
        a, b, c = (pathlib.Path(self.folder, n).read_bytes() for n in ("a.ply", "b.ply", "c.ply"))
        self.assertEqual(a, b)
        self.assertNotEqual(a, c)

    def test_one_bad_file_does_not_hide_the_others(self):
        self.synth("good.ply", "--vertices", "100")
        pathlib.Path(self.folder, "empty.ply").touch()
        code, out, err = dupin(self.folder, "check", "--json", "empty.ply", "none.ply", "good.ply")
        self.assertEqual(code, 4)
        empty, none, good = json.loads(out)
        self.assertEqual((empty["error"]["code"], none["error"]["exit"]), ("E_EMPTY", 3))
        self.assertEqual(good["euler"], 2)
        self.assertIn("E_NOT_FOUND", err)

    def test_people_get_a_table_and_json_stays_alone(self):
        self.synth("good.ply", "--vertices", "100")
        code, out, _ = dupin(self.folder, "check", "good.ply")
        self.assertEqual(code, 0)
        self.assertIn("Euler number", out)
        code, out, err = dupin(self.folder, "check", "--strict", "--json", "nothing.ply")
        self.assertEqual(code, 3)
        self.assertEqual(json.loads(out)["error"]["code"], "E_NOT_FOUND")

    def test_wrong_options_are_usage_errors(self):
        for options in (["--shape", "cube"], ["--vertices", "3"], ["--noise", "-1"]):
            code, _, _ = dupin(self.folder, "synth", "surface", "-o", "x.ply", *options)
            self.assertEqual(code, 2, options)
        self.assertEqual(dupin(self.folder, "synth", "surface", "-o", "x.doc")[0], 2)
        self.assertEqual(os.listdir(self.folder), [])


if __name__ == "__main__":
    unittest.main()
