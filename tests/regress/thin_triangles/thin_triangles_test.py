#!/usr/bin/env python3
"""Cotan weights on very thin triangles: an answer or exit 9, soon. It was exit 2 after 12 s.

usage: thin_triangles_test.py DUPIN
"""
import time
import unittest

from program import Law, json, write_ply

SIDE = 20


class ThinTriangles(Law):
    def grid(self, squeeze):
        points = [(i, j / squeeze, 0.001 * ((i * 7 + j * 3) % 5)) for i in range(SIDE)
                  for j in range(SIDE)]
        faces = []
        for i in range(SIDE - 1):
            for j in range(SIDE - 1):
                a = SIDE * i + j
                faces += [(a, a + SIDE, a + SIDE + 1), (a, a + SIDE + 1, a + 1)]
        write_ply(self.path("thin.ply"), points, faces)

    def test_they_are_a_matter_of_accuracy_not_of_usage(self):
        for squeeze in (10, 1000, 100000):
            self.grid(squeeze)
            start = time.monotonic()
            status, out, err = self.dupin("keypoints", "thin.ply", "--weights", "cotan", "--json")
            self.assertLess(time.monotonic() - start, 5.0, squeeze)
            self.assertIn(status, (0, 9), err)
            if status == 9:
                self.assertEqual(json.loads(out)["error"]["code"], "E_NOT_CONVERGED")

    def test_the_hint_helps(self):
        self.grid(1000)
        self.done("keypoints", "thin.ply", "--weights", "umbrella")


if __name__ == "__main__":
    unittest.main()
