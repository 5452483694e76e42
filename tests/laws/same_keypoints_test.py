#!/usr/bin/env python3
"""What must not change the keypoints of a surface (contract row 11, section 4d).

usage: same_keypoints_test.py DUPIN

A change that rounds the coordinates may move a keypoint between two vertices of equal right, so the
surface is irregular: noise of a tenth of an edge leaves no ties.
"""
import unittest
import zipfile

from program import Law, json, math, os, random, read_ply, write_ply


class SameKeypoints(Law):
    @classmethod
    def setUpClass(cls):
        cls.surface = None

    def setUp(self):
        super().setUp()
        self.synth("plain.ply", "--shape", "bumpy-sphere", "--vertices", "3000", "--noise", "10",
                   "--seed", "7")
        self.points, self.faces = read_ply(self.path("plain.ply"))
        self.plain = self.keypoints("plain.ply")
        self.assertGreaterEqual(len(self.plain), 12, "one for every bump at least")

    def keypoints(self, name, *options):
        found = json.loads(self.done("keypoints", name, "--json", "--quiet", *options))["keypoints"]
        return [(point["vertex"], point["level"], point["kind"]) for point in found]

    def changed(self, points=None, faces=None):
        write_ply(self.path("changed.ply"), self.points if points is None else points,
                  self.faces if faces is None else faces)
        return self.keypoints("changed.ply")

    def scaled(self, factor):
        return [tuple(factor * x for x in point) for point in self.points]

    def si_loc(self, name):
        self.done("scalespace", name, "-o", "stack.npz", "--quiet")
        with zipfile.ZipFile(self.path("stack.npz")) as stack:
            return stack.read("si_loc.npy")

    def test_the_rewritten_surface_is_the_surface(self):
        self.assertEqual(self.changed(), self.plain)

    def test_extreme_units(self):
        for factor in (1e30, 1e-30, 1e-3, 25.4):
            with self.subTest(factor=factor):
                self.assertEqual(self.changed(self.scaled(factor)), self.plain)

    def test_an_offset_of_ten_million(self):
        moved = [tuple(x + 1e7 for x in point) for point in self.points]
        self.assertEqual({point[0] for point in self.changed(moved)},
                         {point[0] for point in self.plain})

    def test_a_power_of_two_changes_no_bit(self):
        plain = self.si_loc("plain.ply")
        for exponent in (-40, -3, 5, 40):
            with self.subTest(exponent=exponent):
                self.assertEqual(self.changed(self.scaled(math.ldexp(1.0, exponent))), self.plain)
                self.assertTrue(self.si_loc("changed.ply") == plain)

    def test_vertices_that_no_face_uses(self):
        self.assertEqual(self.changed(self.points + [(9.0, 9.0, 9.0), (8.0, 8.0, 8.0)]), self.plain)

    def test_faces_said_twice(self):
        self.assertEqual(self.changed(faces=self.faces + self.faces[:50]), self.plain)

    def test_degenerate_faces(self):
        self.assertEqual(self.changed(faces=self.faces + [(0, 0, 1), (5, 5, 5)]), self.plain)

    def test_the_order_of_faces_and_of_their_corners(self):
        shuffled = [face[k:] + face[:k] for k, face in
                    ((i % 3, face) for i, face in enumerate(self.faces))]
        random.Random(1).shuffle(shuffled)
        self.assertEqual({point[0] for point in self.changed(faces=shuffled)},
                         {point[0] for point in self.plain})

    def test_the_order_of_vertices(self):
        order = list(range(len(self.points)))
        random.Random(2).shuffle(order)
        place = [0] * len(order)
        for new, old in enumerate(order):
            place[old] = new
        moved = self.changed([self.points[old] for old in order],
                             [tuple(place[v] for v in face) for face in self.faces])
        self.assertEqual({order[point[0]] for point in moved}, {point[0] for point in self.plain})

    def test_turning_the_surface_inside_out_swaps_bumps_and_hollows(self):
        found = self.changed(faces=[face[::-1] for face in self.faces])
        swap = {"max": "min", "min": "max"}
        self.assertEqual({(v, swap[kind]) for v, _, kind in found},
                         {(v, kind) for v, _, kind in self.plain})


if __name__ == "__main__":
    unittest.main()
