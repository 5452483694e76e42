#!/usr/bin/env python3
"""An option outside its range: exit 2, one line that names the option, one hint (contract row 24).

usage: usage_test.py DUPIN
"""
import unittest

from program import Law, json, os

STACK = [
    ["--delta", "1"], ["--delta", "0.5"], ["--delta", "nan"], ["--delta", "-2"],
    ["--levels", "0"], ["--levels", "1"], ["--levels", "-3"], ["--levels", "2.5"],
    ["--lambda0", "0"], ["--lambda0", "-1"], ["--lambda0", "nan"], ["--lambda0", "x"],
    ["--tolerance", "0"], ["--tolerance", "1"], ["--tolerance", "nan"],
    ["--weights", "uniform"], ["--filter", "box"], ["--signal", "colour"],
]
COMMON = [
    ["--threads", "0"], ["--threads", "-1"], ["--threads", "2000"], ["--timeout", "0"],
    ["--timeout", "-1"], ["--max-vertices", "0"], ["--no-such-option"], ["--seed", "x"],
]
WRONG = {
    "check": COMMON,
    "curvature": COMMON + [["--method", "guess"]],
    "scalespace": COMMON + STACK,
    "keypoints": COMMON + STACK + [["--rule", "best"], ["--level", "-1"], ["--top", "-1"],
                                   ["--rule", "level", "--level", "99"]],
    "crest": COMMON + [["--gamma", "0"], ["--gamma", "nan"], ["--level", "-1"], ["--level", "24"],
                       ["--levels", "1"], ["--filter", "box"], ["--low", "0.5"], ["--noise", "x"],
                       ["--noise", "-1"], ["--replicas", "3"], ["--min-snr", "nan"], ["-o", "x.doc"]],
    "render": COMMON + [["--size", "0x0"], ["--size", "wide"], ["--view", "inside"],
                        ["--color", "pink"], ["--level", "-1"], ["--map", "rainbow"]],
}


class Usage(Law):
    def setUp(self):
        super().setUp()
        self.synth("ball.ply", "--shape", "bumpy-sphere", "--vertices", "500")

    def must_be_refused(self, words):
        before = sorted(os.listdir(self.folder))
        status, out, err = self.dupin(*words)
        lines = err.decode().splitlines()
        self.assertEqual((status, out), (2, b""), (words, err))
        self.assertEqual(len(lines), 2, (words, err))
        self.assertRegex(lines[0], r"^dupin: E_[A-Z]+: .")
        self.assertRegex(lines[1], r"^  hint: .")
        status, out, err = self.dupin(*words, "--json")
        self.assertEqual(status, 2, words)
        self.assertEqual(json.loads(out)["error"]["exit"], 2)
        self.assertEqual(sorted(os.listdir(self.folder)), before, words)

    def test_every_option_of_every_verb(self):
        for verb, wrong in WRONG.items():
            output = ["-o", "x.png"] if verb == "render" else []
            for options in wrong:
                with self.subTest(verb, options=options):
                    self.must_be_refused([verb, "ball.ply", *output, *options])

    def test_words_that_are_missing_or_too_many(self):
        for words in ([], ["nonsense"], ["check"], ["curvature"], ["scalespace"], ["keypoints"],
                      ["render", "ball.ply"], ["keypoints", "ball.ply", "ball.ply"],
                      ["keypoints", "ball.ply", "-o", "x.doc"]):
            with self.subTest(words=words):
                self.must_be_refused(words)

    def test_control_characters_do_not_reach_the_terminal(self):
        _, _, err = self.dupin("check", "--\x1b[31mred")
        self.assertNotIn(b"\x1b", err)


if __name__ == "__main__":
    unittest.main()
