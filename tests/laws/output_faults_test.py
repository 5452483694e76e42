#!/usr/bin/env python3
"""An output that cannot be written: exit 7, and the old file is as it was (contract row 25, G6).

usage: output_faults_test.py DUPIN
"""
import resource
import unittest

from program import Law, become_nobody, json, os

OLD = b"what was there before"
VERBS = {
    "synth": (["synth", "surface", "--vertices", "2000"], "x.ply"),
    "curvature": (["curvature", "ball.ply"], "x.ply"),
    "scalespace": (["scalespace", "ball.ply", "--levels", "5"], "x.npz"),
    "keypoints": (["keypoints", "ball.ply"], "x.json"),
    "crest": (["crest", "ball.ply"], "x.obj"),
    "render": (["render", "ball.ply", "--size", "200x160"], "x.png"),
}


def small_files():
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))


class OutputFaults(Law):
    def setUp(self):
        super().setUp()
        self.synth("ball.ply", "--shape", "bumpy-sphere", "--vertices", "2000")
        self.before = sorted(os.listdir(self.folder))

    def must_fail(self, title, command, output, **options):
        status, out, err = self.dupin(*command, "--json", "-o", output, **options)
        self.assertEqual(status, 7, (title, output, err))
        error = json.loads(out)["error"]
        self.assertEqual((error["exit"], error["code"]), (7, "E_WRITE"), title)
        self.assertIn(b"E_WRITE", err)

    def test_no_room_on_the_device(self):
        for title, (command, name) in VERBS.items():
            link = "full" + os.path.splitext(name)[1]
            os.symlink("/dev/full", self.path(link))
            self.must_fail(title, command, link)
            self.assertTrue(os.path.islink(self.path(link)))
            os.unlink(self.path(link))

    def test_a_directory(self):
        for title, (command, name) in VERBS.items():
            os.mkdir(self.path(name))
            self.must_fail(title, command, name)
            self.assertEqual(os.listdir(self.path(name)), [])
            os.rmdir(self.path(name))

    def test_no_such_folder(self):
        for title, (command, name) in VERBS.items():
            self.must_fail(title, command, "nowhere/" + name)
        self.assertEqual(sorted(os.listdir(self.folder)), self.before)

    def test_a_limit_on_the_size_of_files(self):
        for title, (command, name) in VERBS.items():
            with open(self.path(name), "wb") as old:
                old.write(OLD)
            self.must_fail(title, command, name, preexec_fn=small_files)
            with open(self.path(name), "rb") as old:
                self.assertEqual(old.read(), OLD, title)
            os.unlink(self.path(name))
            self.assertEqual(sorted(os.listdir(self.folder)), self.before, title)

    def test_a_folder_and_a_file_that_may_not_be_written(self):
        closed = self.path("closed")
        os.mkdir(closed)
        for _, (_, name) in VERBS.items():
            with open(os.path.join(closed, name), "wb") as old:
                old.write(OLD)
        os.chmod(closed, 0o555)
        program = self.open_program()
        names = sorted(os.listdir(closed))
        for title, (command, name) in VERBS.items():
            for output in (name, "new-" + name):
                self.must_fail(title, command, os.path.join("closed", output), program=program,
                               preexec_fn=become_nobody)
            with open(os.path.join(closed, name), "rb") as old:
                self.assertEqual(old.read(), OLD, title)
        self.assertEqual(sorted(os.listdir(closed)), names)

    def test_standard_output_is_full_or_closed(self):
        for command in (["check", "ball.ply"], ["keypoints", "ball.ply"]):
            for form in ([], ["--json"]):
                with open("/dev/full", "wb") as full:
                    status, _, err = self.dupin(*command, *form, stdout=full)
                self.assertEqual(status, 7, (command, form, err))
            reader, writer = os.pipe()
            os.close(reader)
            status, _, err = self.dupin(*command, "--json", stdout=writer)
            os.close(writer)
            self.assertEqual(status, 7, (command, err))


if __name__ == "__main__":
    unittest.main()
