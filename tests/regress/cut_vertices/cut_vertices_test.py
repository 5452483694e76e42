#!/usr/bin/env python3
"""Counts are those of the input where the surface was cut: two tetrahedra that share a vertex.

usage: cut_vertices_test.py DUPIN
"""
import unittest

from program import Law, json, write_ply

CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1)]
TWO = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3), (0, 5, 4), (0, 4, 6), (0, 6, 5), (4, 5, 6)]


class CutVertices(Law):
    def setUp(self):
        super().setUp()
        # Two more vertices belong to no face: they are skipped, and nothing else is.
        write_ply(self.path("two.ply"), CORNERS + [(5, 5, 5), (6, 6, 6)], TWO)

    def test_skipped_vertices_are_those_without_a_face(self):
        document = json.loads(self.done("curvature", "two.ply", "--json"))
        self.assertEqual(document["skipped_vertices"], 2)

    def test_a_picture_tells_the_vertices_of_the_input_and_the_repairs(self):
        document = json.loads(self.done("render", "two.ply", "-o", "x.png", "--size", "64x64",
                                        "--json"))
        self.assertEqual((document["vertices"], document["faces"]), (9, 8))
        codes = [warning["code"] for warning in document["warnings"]]
        self.assertIn("W_NONMANIFOLD_VERTEX", codes)
        self.assertIn("W_ISOLATED_VERTEX", codes)


if __name__ == "__main__":
    unittest.main()
