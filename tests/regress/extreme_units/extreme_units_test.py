#!/usr/bin/env python3
"""A result that a double cannot hold is exit 9, E_RANGE; keypoints printed null, scalespace wrote inf.

usage: extreme_units_test.py DUPIN
"""
import unittest

from program import Law, json, os, read_ply, write_ply


class ExtremeUnits(Law):
    def setUp(self):
        super().setUp()
        self.synth("a.ply", "--shape", "bumpy-sphere", "--vertices", "2000")
        points, faces = read_ply(self.path("a.ply"))
        write_ply(self.path("tiny.ply"), [tuple(1e-160 * x for x in p) for p in points], faces)

    def test_the_square_of_a_curvature_beyond_all_numbers(self):
        for words in (["curvature"], ["keypoints", "--signal", "K"],
                      ["scalespace", "--signal", "K", "-o", "out.npz"],
                      ["render", "--color", "K", "-o", "out.png", "--size", "64x64"]):
            status, out, err = self.dupin(words[0], "tiny.ply", *words[1:], "--json")
            self.assertEqual((status, json.loads(out).get("error", {}).get("code")),
                             (9, "E_RANGE"), (words, err))
            self.assertEqual(sorted(os.listdir(self.folder)), ["a.ply", "tiny.ply"])

    def test_what_a_number_holds_is_told(self):
        found = json.loads(self.done("keypoints", "tiny.ply", "--json"))["keypoints"]
        self.assertGreater(len(found), 0)
        self.assertTrue(all(abs(p["response"]) > 1e150 for p in found))


if __name__ == "__main__":
    unittest.main()
