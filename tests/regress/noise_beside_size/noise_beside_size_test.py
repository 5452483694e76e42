#!/usr/bin/env python3
"""A noise that has nothing to do with the size of the surface is a matter of usage, said so; an error
of an analysis names its file. Both spoke of a covariance instead, or of no file.

usage: noise_beside_size_test.py DUPIN
"""
import unittest

from program import Law, json, random


class NoiseBesideSize(Law):
    def cloud(self, name, unit):
        draw = random.Random(1)
        with open(self.path(name), "w", encoding="ascii") as file:
            for _ in range(300):
                x, y = draw.random(), draw.random()
                file.write(f"{unit * x!r} {unit * y!r} {unit * 0.1 * x * y!r}\n")

    def refused(self, words):
        status, out, err = self.dupin(*words, "--json")
        self.assertEqual(status, 2, (words, err))
        self.assertIn("noise is", json.loads(out)["error"]["message"])

    def test_far_too_much_or_nothing(self):
        self.cloud("tiny.xyz", 1e-170)
        self.refused(["mls", "scale", "tiny.xyz", "--noise", "0.01", "--vertex", "3"])
        self.refused(["keypoints", "tiny.xyz", "--noise", "0.01"])
        self.cloud("huge.xyz", 1e200)
        self.refused(["mls", "scale", "huge.xyz", "--noise", "0.01", "--vertex", "3"])
        self.done("keypoints", "huge.xyz", "--noise", "0.01", "--json")

    def test_an_analysis_that_fails_names_the_file(self):
        with open(self.path("line.xyz"), "w", encoding="ascii") as file:
            for i in range(200):
                file.write(f"{i} {2 * i} {3 * i}\n")
        status, _, err = self.dupin("mls", "noise", "line.xyz")
        self.assertEqual(status, 5)
        self.assertTrue(err.startswith(b"dupin: line.xyz: E_DEGENERATE: "), err)
        # Rounding across an oblique line is no second direction: it gave curvatures of 1e14.
        status, _, err = self.dupin("mls", "curvature", "line.xyz", "-o", "out.ply")
        self.assertEqual(status, 5)
        self.assertIn(b"line.xyz: E_ALL_DEGENERATE: ", err)


if __name__ == "__main__":
    unittest.main()
