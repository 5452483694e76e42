#!/usr/bin/env python3
"""`dupin mls` and `dupin curvature --method mls` as users meet them: noise in the unit of the input, points
without faces, and surfaces too small for a patch.

usage: mls_test.py DUPIN
"""
import math
import unittest

from program import Law, json, os, read_ply


class Mls(Law):
    def points(self, name):
        return read_ply(self.path(name))[0]

    def json_of(self, *words, status=0):
        code, out, err = self.dupin(*words, "--json")
        self.assertEqual(code, status, (words, err))
        return json.loads(out)

    def test_noise_is_found_in_the_unit_of_the_input(self):
        made = self.json_of("synth", "surface", "--shape", "torus", "--vertices", "20000", "--noise", "50",
                            "-o", "torus.ply")
        found = self.json_of("mls", "noise", "torus.ply", "--samples", "0")
        self.assertLess(abs(found["sigma"] / made["noise_sigma"] - 1), 0.03)
        self.assertLess(found["sigma_standard_error"], 0.02 * found["sigma"])
        with open(self.path("torus.xyz"), "w", encoding="ascii") as out:  # no faces, in thousandths, moved
            for x, y, z in self.points("torus.ply"):
                out.write(f"{1000 * x + 5000!r} {1000 * y!r} {1000 * z!r}\n")
        cloud = self.json_of("mls", "noise", "torus.xyz", "--samples", "0")
        self.assertLess(abs(cloud["sigma"] / found["sigma"] / 1000 - 1), 1e-6)

    def test_smoothing_takes_the_noise_away_and_keeps_the_faces(self):
        self.dupin("synth", "surface", "--shape", "sphere", "--vertices", "5000", "--noise", "50", "-o", "a.ply")
        answer = self.json_of("mls", "smooth", "a.ply", "-o", "b.ply")
        self.assertEqual(answer["left_alone"], 0)
        before = self.json_of("check", "a.ply")
        after = self.json_of("check", "b.ply")
        self.assertEqual((before["vertices"], before["faces"]), (after["vertices"], after["faces"]))
        rough = [math.dist(p, (0, 0, 0)) - 1 for p in self.points("a.ply")]
        smooth = [math.dist(p, (0, 0, 0)) - 1 for p in self.points("b.ply")]
        self.assertLess(sum(r * r for r in smooth), sum(r * r for r in rough) / 16)

    def test_curvature_of_points_has_deviations(self):
        self.dupin("synth", "surface", "--shape", "sphere", "--vertices", "3000", "-o", "s.ply")
        with open(self.path("s.xyz"), "w", encoding="ascii") as out:
            for p in self.points("s.ply"):
                out.write(" ".join(map(repr, p)) + "\n")
        for words in (["curvature", "s.xyz", "--method", "mls"], ["mls", "curvature", "s.xyz"],
                      ["curvature", "s.xyz", "--method", "jet"]):
            answer = self.json_of(*words)
            self.assertAlmostEqual(answer["mean"]["H"]["mean"], 1.0, delta=0.04)
            self.assertLess(answer["mean"]["H_sd"]["max"], 0.05)
            self.assertEqual(answer["orders"], {"10": len(self.points("s.ply")), "6": 0, "3": 0, "0": 0})
        answer = self.json_of("curvature", "s.xyz", status=5)  # Taubin needs faces
        self.assertEqual(answer["error"]["code"], "E_NO_FACES")

    def test_patches_find_the_bumps_as_faces_do(self):
        # Level 14 is about the width of a bump. A bump has one place, and every signal has a minimum there, within
        # 1.5 edges: one for the nearest vertex, half of one for the smoothing. Between bumps the sphere is round;
        # maxima lie in moats about the bumps, wherever the mesh puts them, and have no place to compare.
        for seed in ("0", "2", "5"):  # with other seeds bumps overlap
            self.dupin("synth", "surface", "--shape", "bumpy-sphere", "--vertices", "4000", "--seed", seed, "-o", "b.ply")
            points = self.points("b.ply")
            found = {name: self.json_of("keypoints", "b.ply", "--signal", name, "--rule", "level", "--level", "14")
                     for name in ("mls-H", "H")}
            edge = found["H"]["mean_edge_length"]
            tops = []
            for p in sorted(points, key=lambda p: -math.dist(p, (0, 0, 0))):
                if all(math.dist(p, q) > 6 * edge for q in tops):
                    tops.append(p)
                if len(tops) == 12:
                    break
            for name, answer in found.items():
                bumps = [points[k["vertex"]] for k in answer["keypoints"] if k["kind"] == "min"]
                self.assertLessEqual(len(bumps), 15, name)  # 12, and a few of the noise of the mesh
                for top in tops:
                    self.assertLess(min(math.dist(top, p) for p in bumps), 1.5 * edge, (name, seed))

    def test_too_few_points_are_an_answer_of_their_own(self):
        for count, words in ((2, ["mls", "curvature"]), (9, ["mls", "noise"])):
            with open(self.path("few.xyz"), "w", encoding="ascii") as out:
                out.writelines(f"{i} {i * i % 7} {i % 3}\n" for i in range(count))
            answer = self.json_of(*words, "few.xyz", status=5)
            self.assertEqual(answer["error"]["code"], "E_TOO_FEW_POINTS")
            # --neighbors of these verbs is that of a patch, and does not help here.
            self.assertNotIn("fewer neighbours: --neighbors", answer["error"]["hint"])
        with open(self.path("line.xyz"), "w", encoding="ascii") as out:
            out.writelines(f"{i} 0 0\n" for i in range(50))
        answer = self.json_of("mls", "noise", "line.xyz", status=5)
        self.assertEqual(answer["error"]["code"], "E_DEGENERATE")

    def test_a_radius_and_a_number_of_neighbours_exclude_each_other(self):
        self.dupin("synth", "surface", "--shape", "torus", "--vertices", "500", "-o", "t.ply")
        for words in (["mls", "smooth", "t.ply", "-o", "s.ply"], ["mls", "curvature", "t.ply"],
                      ["curvature", "t.ply", "--method", "mls"]):
            with self.subTest(words=words):
                self.assertEqual(self.dupin(*words, "--neighbors", "40", "--radius", "0.3")[0], 2)
                self.assertEqual(self.dupin(*words, "--radius", "0.3")[0], 0)

    def test_the_answer_is_the_same_for_every_number_of_threads(self):
        self.dupin("synth", "surface", "--shape", "torus", "--vertices", "4000", "--noise", "20", "-o", "t.ply")
        written = set()
        for threads in "128":
            self.dupin("curvature", "t.ply", "--method", "mls", "-o", "c.ply", "--threads", threads)
            with open(self.path("c.ply"), "rb") as file:
                written.add(file.read())
            os.remove(self.path("c.ply"))
        self.assertEqual(len(written), 1)


if __name__ == "__main__":
    unittest.main()
