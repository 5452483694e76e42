#!/usr/bin/env python3
"""Options of keypoints that meant something else than they said.

- --min-contrast depended on a power of two that nobody sees (12 keypoints at scale 1, none at 1.8)
- --preset thesis overrode options silently, and gave t under the name of tau
- levels beyond the stack, NaN and the tensor were refused late or not at all

usage: keypoint_options_test.py DUPIN
"""
import unittest

from program import Law, json, read_ply, struct, write_ply


class KeypointOptions(Law):
    def setUp(self):
        super().setUp()
        self.synth("a.ply", "--shape", "bumpy-sphere", "--vertices", "4000")

    def keypoints(self, name, *options):
        return json.loads(self.done("keypoints", name, "--json", *options))["keypoints"]

    def test_the_contrast_does_not_depend_on_the_unit(self):
        points, faces = read_ply(self.path("a.ply"))
        with open(self.path("signal.npy"), "wb") as out:
            head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({len(points)},), }}".encode()
            head += b" " * (117 - len(head)) + b"\n"
            out.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head)
            for x, y, z in points:
                out.write(struct.pack("<d", x * x + 0.3 * y * z))
        for signal, power in (("height", 1), ("H", 1), ("K", 2), ("signal.npy", 0)):
            options = ["--signal", signal, "--min-level", "4"]
            contrasts = sorted(abs(p["response"]) * p["radius"] ** power
                               for p in self.keypoints("a.ply", *options))
            middle = len(contrasts) // 2
            self.assertGreater(len(contrasts), 3, signal)
            limit = 0.5 * (contrasts[middle - 1] + contrasts[middle])
            expected = None
            for scale in (1.0, 1.8, 0.003, 1000.0):
                write_ply(self.path("b.ply"), [tuple(scale * x for x in p) for p in points], faces)
                found = self.keypoints("b.ply", *options, "--min-contrast", repr(limit))
                ids = sorted(p["vertex"] for p in found)
                expected = expected or ids
                self.assertEqual(len(ids), len(contrasts) - middle, (signal, scale))
                self.assertEqual(ids, expected, (signal, scale))

    def test_the_preset_is_not_contradicted(self):
        for option in (["--rule", "level", "--level", "5"], ["--signal", "height"],
                       ["--weights", "cotan"], ["--filter", "heat"], ["--radius", "exact"]):
            status, _, err = self.dupin("keypoints", "a.ply", "--preset", "thesis", *option)
            self.assertEqual(status, 2, (option, err))
            self.assertIn(option[0].encode(), err)
        self.keypoints("a.ply", "--preset", "thesis", "--rule", "space-scale", "--signal", "H")

    def test_the_preset_tells_tau_and_t(self):
        document = json.loads(self.done("keypoints", "a.ply", "--preset", "thesis", "--json"))
        edge, tau = document["mean_edge_length"], document["tau"]
        self.assertGreater(len(document["keypoints"]), 0)
        for p in document["keypoints"]:
            self.assertAlmostEqual(p["radius"], p["t"] * edge, delta=1e-9 * p["radius"])
            self.assertLessEqual(tau[p["level"] - 1], p["tau"])
            self.assertLessEqual(p["tau"], tau[p["level"] + 1])
        self.assertNotIn("t", self.keypoints("a.ply")[0])

    # Before anything is read: the surface does not even exist.
    def test_wrong_options_are_refused_before_reading(self):
        for options in (["--level", "999"], ["--level", "34"], ["--rule", "level", "--level", "99"],
                        ["--min-level", "40"], ["--signal", "tensor"], ["--min-contrast", "nan"],
                        ["--levels", "10", "--level", "20"], ["--tolerance", "nan"],
                        ["--lambda0", "nan"], ["--max-edge-ratio", "nan"]):
            self.assertEqual(self.dupin("keypoints", "missing.ply", *options)[0], 2, options)

    # The level that nobody gave may lie beyond a short stack.
    def test_a_short_stack_needs_no_level(self):
        self.keypoints("a.ply", "--levels", "10", "--min-level", "2")


if __name__ == "__main__":
    unittest.main()
