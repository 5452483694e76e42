#!/usr/bin/env python3
"""Names that are no UTF-8 do not break the JSON (E_INTERNAL, exit 70), and every error names its file.

usage: file_names_test.py DUPIN
"""
import unittest

from program import Law, json, os

ODD = b"a\xff\xfeb.ply"


class FileNames(Law):
    def test_a_name_that_is_no_utf8_gives_json(self):
        self.synth("a.ply", "--shape", "bumpy-sphere", "--vertices", "300")
        os.rename(self.path("a.ply"), os.path.join(os.fsencode(self.folder), ODD))
        status, out, err = self.dupin("check", ODD, "--json")
        self.assertEqual(status, 0, err)
        self.assertIn("a\ufffd", json.loads(out)["file"])
        status, out, err = self.dupin("render", ODD, "--json", "-o", b"\xff.png", "--size", "64x64")
        self.assertEqual(status, 0, err)
        self.assertEqual(json.loads(out)["output"], "\ufffd.png")
        status, out, err = self.dupin("check", b"\xff/missing.ply", "--json")
        self.assertEqual((status, json.loads(out)["error"]["code"]), (3, "E_NOT_FOUND"))

    # A cloud's errors come from the analysis, which knows no file.
    def test_the_errors_of_a_cloud_name_its_file(self):
        with open(self.path("three.xyz"), "w") as out:
            out.write("0 0 0\n1 0 0\n0 1 0\n")
        with open(self.path("one.xyz"), "w") as out:
            out.write("1 2 3\n" * 20)
        for verb, options in (("keypoints", []), ("scalespace", []), ("render", ["-o", "x.png"])):
            for name in ("three.xyz", "one.xyz"):
                status, out, err = self.dupin(verb, name, *options, "--json")
                self.assertEqual(status, 5, err)
                self.assertEqual(json.loads(out)["error"]["file"], name)
                self.assertRegex(err.decode(), rf"^dupin: {name}: E_")


if __name__ == "__main__":
    unittest.main()
