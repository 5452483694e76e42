#!/usr/bin/env python3
"""Every warning has a place, is told on stderr, and is an error with --strict. Those of the operator
came too late for both, and those of normals had no place.

usage: strict_test.py DUPIN
"""
import unittest

from program import Law, json, write_ply


class Strict(Law):
    def warned(self, code, place, *arguments):
        status, out, err = self.dupin(*arguments, "--json")
        self.assertEqual(status, 0, err)
        warning = next(w for w in json.loads(out)["warnings"] if w["code"] == code)
        self.assertEqual(warning["first"], place)
        self.assertIn(code.encode(), err)
        self.assertIn(place.encode(), err)
        status, out, err = self.dupin(*arguments, "--json", "--strict")
        self.assertEqual(status, 4, err)
        self.assertEqual(json.loads(out)["error"]["code"], code)
        status, _, err = self.dupin(*arguments, "--quiet")
        self.assertEqual((status, err), (0, b""))

    def test_clamped_weights_of_the_operator(self):
        # Sheared squares: both angles that face their long diagonal are obtuse, so its weight is negative.
        points = [(i + 2 * j, 0.5 * j, 0.01 * i * j) for j in range(6) for i in range(6)]
        faces = []
        for a in (i + 6 * j for j in range(5) for i in range(5)):
            faces += [(a, a + 1, a + 7), (a, a + 7, a + 6)]
        write_ply(self.path("sheared.ply"), points, faces)
        self.warned("W_WEIGHT_CLAMPED", "edge at vertex 0", "scalespace", "sheared.ply", "--weights",
                    "cotan", "--levels", "3")

    def test_normals_of_a_cloud(self):
        length = {41: 3, 57: 0}
        with open(self.path("cloud.ply"), "w", encoding="ascii") as file:
            file.write("ply\nformat ascii 1.0\nelement vertex 100\n")
            file.write("".join(f"property float {name}\n" for name in "x y z nx ny nz".split()))
            file.write("end_header\n")
            for v in range(100):
                i, j = v % 10, v // 10
                file.write(f"{i} {j} {0.01 * i * j} 0 0 {length.get(v, 1)}\n")
        self.warned("W_NORMAL_LENGTH", "point 41", "keypoints", "cloud.ply")
        status, out, _ = self.dupin("keypoints", "cloud.ply", "--json")
        self.assertEqual(status, 0)
        places = {w["code"]: w["first"] for w in json.loads(out)["warnings"]}
        self.assertEqual(places, {"W_NORMAL_LENGTH": "point 41", "W_NORMAL_ESTIMATED": "point 57"})

    def test_the_first_point_that_was_dropped(self):
        with open(self.path("cloud.xyz"), "w", encoding="ascii") as file:
            for i in range(100):
                z = "nan" if i in (31, 32, 77) else f"{0.01 * i}"
                file.write(f"{i % 10} {i // 10} {z}\n")
        self.warned("W_NONFINITE_DROPPED", "point 31", "keypoints", "cloud.xyz", "--drop-nonfinite")


if __name__ == "__main__":
    unittest.main()
