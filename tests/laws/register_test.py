#!/usr/bin/env python3
"""`dupin register` as users meet it: fields, truth, units, outputs, and what is refused.

usage: register_test.py DUPIN
"""
import math
import unittest

from program import Law, json, read_ply, write_ply

FIELDS = ["accepted", "refusal", "transform", "scale", "rotation", "translation", "overlap", "overlap_fixed", "conflict",
          "rmse", "inliers", "correspondences", "confidence", "rotation_sd", "translation_sd", "scale_sd", "alternatives",
          "seconds", "warnings"]


def times(a, b):
    return [[sum(a[r][k] * b[k][c] for k in range(4)) for c in range(4)] for r in range(4)]


def inverse(m):
    """Of a rotation and a shift."""
    turned = [[m[c][r] for c in range(3)] for r in range(3)]
    shift = [-sum(turned[r][k] * m[k][3] for k in range(3)) for r in range(3)]
    return [turned[r] + [shift[r]] for r in range(3)] + [[0, 0, 0, 1]]


def angle_deg(a, b):
    trace = sum(a[r][c] * b[r][c] for r in range(3) for c in range(3))
    return math.degrees(math.acos(max(-1.0, min(1.0, (trace - 1.0) / 2.0))))


class Register(Law):
    def setUp(self):
        """Two views of a bumpy body, 40 degrees apart, each in a pose of its own."""
        super().setUp()
        self.synth("b.ply", "--shape", "bumpy-sphere", "--vertices", "6000", "--seed", "5")
        document = json.loads(self.done("synth", "views", "b.ply", "-o", "v", "--count", "2", "--step", "40", "--shuffle",
                                        "--rows", "90", "--cols", "90", "--seed", "2", "--json"))
        self.moving, self.fixed = document["views"]
        self.files = ["v/" + self.moving["file"], "v/" + self.fixed["file"]]
        self.truth = times(inverse(self.fixed["T_input_view"]), self.moving["T_input_view"])

    def register(self, *words, status=0):
        code, out, err = self.dupin("register", *words, "--json", "--quiet")
        self.assertEqual(code, status, (words, out, err))
        return json.loads(out)

    def test_two_views_come_together(self):
        answer = self.register(*self.files, "--scale", "fixed", "-o", "a.ply", "--fused", "f.ply")
        self.assertEqual(list(answer), FIELDS)
        self.assertTrue(answer["accepted"])
        self.assertEqual((answer["refusal"], answer["scale"]), ("none", 1.0))
        self.assertLess(angle_deg(answer["transform"], self.truth), 1.0)
        for r in range(3):
            self.assertAlmostEqual(answer["transform"][r][3], self.truth[r][3], delta=0.03)
            self.assertEqual(answer["transform"][r][:3], answer["rotation"][r])
        self.assertGreater(answer["overlap"], 0.4)
        # The output is the moving scan under the matrix, the fused one both.
        before, _ = read_ply(self.path(self.files[0]))
        after, _ = read_ply(self.path("a.ply"))
        both, _ = read_ply(self.path("f.ply"))
        self.assertEqual(len(both), self.moving["points"] + self.fixed["points"])
        for p, q in list(zip(before, after))[::97]:
            for r in range(3):
                moved = sum(answer["transform"][r][c] * p[c] for c in range(3)) + answer["transform"][r][3]
                self.assertAlmostEqual(q[r], moved, delta=1e-5)

    def test_millimetres_and_metres(self):
        points, faces = read_ply(self.path(self.files[0]))
        write_ply(self.path("mm.ply"), [[1000.0 * x for x in p] for p in points], faces)
        answer = self.register("mm.ply", self.files[1])
        self.assertAlmostEqual(answer["scale"], 1e-3, delta=1e-5)
        # In one unit they do not fit: exit 1, and the best that was found is still told.
        refused = self.register("mm.ply", self.files[1], "--scale", "fixed", status=1)
        self.assertFalse(refused["accepted"])
        self.assertEqual(list(refused), FIELDS)

    def test_other_objects_and_what_slides_are_refused(self):
        self.synth("s.ply", "--shape", "sphere", "--vertices", "3000")
        self.assertNotEqual(self.register("s.ply", "s.ply", "--scale", "fixed", status=1)["refusal"], "none")
        self.assertFalse(self.register(self.files[0], "s.ply", status=1)["accepted"])

    def test_limits(self):
        turn = self.register(*self.files, "--max-rotation", "0.001", status=1)
        self.assertEqual(turn["refusal"], "rotation")

    def test_without_icp_the_features_speak(self):
        """Near the truth, as three mean edges over the size of the body allow, but not refined."""
        refined = self.register(*self.files, "--scale", "fixed")
        answer = self.register(*self.files, "--scale", "fixed", "--refine", "none")
        self.assertTrue(answer["accepted"])
        self.assertEqual(answer["confidence"], refined["confidence"])
        self.assertIsNone(answer["rotation_sd"])
        self.assertLess(angle_deg(answer["transform"], self.truth), 12.0)
        self.assertGreater(angle_deg(answer["transform"], refined["transform"]), 0.01)

    def test_bad_input(self):
        write_ply(self.path("few.ply"), [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        self.assertEqual(self.register("few.ply", self.files[1], status=5)["error"]["code"], "E_TOO_FEW_POINTS")
        self.assertEqual(self.register("-", "-", status=2)["error"]["exit"], 2)
        self.register(*self.files, "-o", "a.xyz", status=2)
        self.register(self.files[0], "missing.ply", status=3)
        self.register(*self.files, "--max-rotation", "nan", status=2)
        self.register(*self.files, "-o", "one.ply", "--fused", "one.ply", status=2)


if __name__ == "__main__":
    unittest.main()
