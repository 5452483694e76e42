#!/usr/bin/env python3
"""Standard output holds one thing: the surface, picture or table that -o - asks for, or the JSON.

usage: standard_output_test.py DUPIN
"""
import unittest

from program import Law


class StandardOutput(Law):
    def test_an_output_is_alone(self):
        self.assertTrue(self.done("synth", "surface", "-o", "-", "--format", "off").startswith(b"OFF"))
        self.synth("a.ply", "--vertices", "300")
        self.assertTrue(self.done("render", "a.ply", "-o", "-", "--size", "64x64").endswith(b"IEND\xaeB`\x82"))
        self.assertTrue(self.done("keypoints", "a.ply", "-o", "-", "--format", "csv").startswith(b"vertex,"))

    def test_what_cannot_be_is_refused(self):
        for words in (["scalespace", "a.ply", "-o", "-", "--json"], ["keypoints", "a.ply", "-o", "-"],
                      ["scalespace", "a.ply", "-o", "x.txt"], ["render", "a.ply", "-o", "l.gif"],
                      ["check", "a.ply", "--seed", "-1"]):
            self.assertEqual(self.dupin(*words)[0], 2, words)
        with open("/dev/full", "wb") as full:
            self.assertEqual(self.dupin("--help", stdout=full)[0], 7)


if __name__ == "__main__":
    unittest.main()
