#!/usr/bin/env python3
"""--timeout ends every verb with exit 6, E_TIMEOUT and no output; it was 130 for all but check.

usage: timeout_test.py DUPIN
"""
import unittest

from program import Law, json, os

VERBS = {
    "check": [],
    "curvature": ["-o", "out.ply"],
    "scalespace": ["-o", "out.npz"],
    "keypoints": ["-o", "out.json"],
    "render": ["-o", "out.png"],
}


class Timeout(Law):
    def setUp(self):
        super().setUp()
        self.synth("big.ply", "--shape", "sphere", "--vertices", "400000")

    def test_every_verb_gives_up_with_nothing_written(self):
        before = sorted(os.listdir(self.folder))
        for verb, options in VERBS.items():
            with self.subTest(verb):
                status, out, err = self.dupin(verb, "big.ply", *options, "--timeout", "0.05", "--json")
                self.assertEqual(status, 6, err)
                error = json.loads(out)["error"]
                self.assertEqual((error["exit"], error["code"]), (6, "E_TIMEOUT"))
                self.assertRegex(err.decode(), r"(?m)^dupin: (big.ply: )?E_TIMEOUT: .*\n  hint: ")
                self.assertEqual(sorted(os.listdir(self.folder)), before)

    # Cancelling is for good: the files after the one that took too long are not looked at, and say so.
    def test_the_judgements_before_it_are_kept(self):
        self.synth("small.ply", "--shape", "sphere", "--vertices", "100")
        status, out, _ = self.dupin("check", "small.ply", "big.ply", "small.ply", "--timeout", "0.2",
                                    "--json")
        documents = json.loads(out)
        self.assertEqual((status, len(documents)), (6, 3))
        self.assertEqual(documents[0]["vertices"], 92)
        for document in documents[1:]:
            self.assertEqual(document["error"]["code"], "E_TIMEOUT")

    # Wherever the demo is stopped, the pictures that it leaves are whole: the same bytes as without.
    def test_a_demo_leaves_no_half_page_and_no_half_picture(self):
        self.done("demo", "whole")
        kept = 0
        for seconds in ("0.3", "0.6", "1.0"):
            page = "page" + seconds
            status, _, err = self.dupin("demo", page, "--timeout", seconds)
            if status == 0:
                break
            self.assertEqual(status, 6, err)
            self.assertFalse(os.path.exists(self.path(page, "index.html")))
            for name in os.listdir(self.path(page)):
                with open(self.path(page, name), "rb") as a, open(self.path("whole", name), "rb") as b:
                    self.assertEqual(a.read(), b.read(), (page, name))
                kept += 1
        print("files of stopped demos that were compared:", kept)

    def test_a_time_that_is_none_is_refused(self):
        for text in ("nan", "inf", "0", "-1", "x"):
            self.assertEqual(self.dupin("check", "big.ply", "--timeout", text)[0], 2, text)

    def test_a_long_time_changes_nothing(self):
        self.assertEqual(self.dupin("check", "big.ply", "--timeout", "1000")[0], 0)


if __name__ == "__main__":
    unittest.main()
