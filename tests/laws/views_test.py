#!/usr/bin/env python3
"""`dupin synth views`: partial scans whose truth is in views.json.

usage: views_test.py DUPIN
"""
import unittest

from program import Law, json, os, read_ply


def apply(matrix, point):
    return [sum(matrix[r][c] * point[c] for c in range(3)) + matrix[r][3] for r in range(3)]


class Views(Law):
    def setUp(self):
        super().setUp()
        self.synth("s.ply", "--shape", "sphere", "--vertices", "4000")

    def views(self, name, *options):
        document = json.loads(self.done("synth", "views", "s.ply", "-o", name, "--rows", "40",
                                        "--cols", "60", "--json", *options))
        with open(self.path(name, "views.json"), encoding="utf-8") as file:
            self.assertEqual(json.load(file), document)
        return document["views"]

    def contents(self, folder):
        out = {}
        for name in os.listdir(self.path(folder)):
            with open(self.path(folder, name), "rb") as file:
                out[name] = file.read()
        return out

    def points(self, name, view):
        """The points of a view, where its truth says that they belong."""
        points, _ = read_ply(self.path(name, view["file"]))
        self.assertEqual(len(points), view["points"])
        return [apply(view["T_input_view"], point) for point in points]

    def test_the_truth_takes_every_point_back_to_the_surface(self):
        """Facets of a sphere of 4000 vertices (edge .06, circumradius .035) lie at most 6e-4
        inside it."""
        cases = ([], ["--shuffle", "--seed", "3"], ["--perspective", "0", "--elevation", "40"])
        for number, options in enumerate(cases):
            name = f"v{number}"
            views = self.views(name, "--count", "5", "--step", "70", *options)
            self.assertEqual(sorted(view["position"] for view in views), list(range(5)))
            for view in views:
                points = self.points(name, view)
                self.assertGreater(len(points), 300)
                for point in points:
                    radius = sum(x * x for x in point) ** 0.5
                    self.assertLess(radius, 1.0 + 1e-9)
                    self.assertGreater(radius, 1.0 - 1e-3)

    def test_views_look_from_their_azimuth(self):
        """The mean of the points lies towards the camera: 0 is +z, 90 is +x."""
        for view in self.views("v", "--count", "2", "--step", "90"):
            points = self.points("v", view)
            mean = [sum(p[c] for p in points) / len(points) for c in range(3)]
            axis = 2 if view["azimuth_deg"] == 0.0 else 0
            self.assertGreater(mean[axis], 0.5)
            self.assertLess(max(abs(mean[c]) for c in range(3) if c != axis), 0.05)

    def test_the_seed_decides_order_pose_and_noise(self):
        options = ["--count", "6", "--shuffle", "--noise", "20", "--seed"]
        one = self.views("a", *options, "1")
        self.assertEqual(one, self.views("b", *options, "1", "--threads", "1"))
        two = self.views("c", *options, "2")
        self.assertNotEqual(one[0]["T_input_view"], two[0]["T_input_view"])
        self.assertNotEqual([view["position"] for view in one], list(range(6)))
        self.assertGreater(one[0]["noise_sigma"], 0.0)
        for view in one:
            self.assertEqual(self.points("a", view), self.points("b", view))

    def test_an_interrupted_run_leaves_no_part_of_a_set(self):
        """Neither where nothing was, nor beside an older set."""
        self.synth("large.ply", "--shape", "torus", "--vertices", "200000")
        slow = ["synth", "views", "large.ply", "--count", "400", "--rows", "200", "--cols", "200", "--timeout", "3"]
        self.assertEqual(self.dupin(*slow, "-o", "new")[0], 6)
        self.assertFalse(os.path.exists(self.path("new")))
        self.views("old", "--count", "3")
        before = self.contents("old")
        self.assertEqual(sorted(before), ["view_000.ply", "view_001.ply", "view_002.ply", "views.json"])
        self.assertEqual(self.dupin(*slow, "-o", "old")[0], 6)
        self.assertEqual(self.contents("old"), before)

    def test_bad_requests_are_refused(self):
        with open(self.path("cloud.xyz"), "w", encoding="utf-8") as file:
            file.write("".join(f"{i % 7} {i % 5} {i % 3}\n" for i in range(105)))
        for code, arguments in ((2, ["s.ply", "-o", "v", "--count", "0"]),
                                (2, ["s.ply", "-o", "v", "--perspective", "0.9"]),
                                (3, ["absent.ply", "-o", "v"]),
                                (5, ["cloud.xyz", "-o", "v"]),
                                (7, ["s.ply", "-o", "s.ply/v"])):
            self.assertEqual(self.dupin("synth", "views", *arguments)[0], code, arguments)


if __name__ == "__main__":
    unittest.main()
