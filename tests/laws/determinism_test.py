#!/usr/bin/env python3
"""Same input, same bytes: whatever the threads, the language, the time zone or the folder (G5).

usage: determinism_test.py DUPIN
"""
import re
import subprocess
import unittest

from program import Law, become_nobody, os

VERBS = {
    "curvature": ["curvature", "ball.ply", "-o", "OUT/c.ply"],
    "scalespace": ["scalespace", "ball.ply", "-o", "OUT/s.npz"],
    "cotan stack of H": ["scalespace", "ball.ply", "--weights", "cotan", "--signal", "H", "-o",
                         "OUT/t.npz"],
    "keypoints": ["keypoints", "ball.ply", "-o", "OUT/k.ply"],
    "keypoints in space and scale": ["keypoints", "ball.ply", "--rule", "space-scale"],
    "crest": ["crest", "ball.ply", "--noise", "auto", "--replicas", "4", "-o", "OUT/l.ply"],
    "render": ["render", "ball.ply", "--color", "si_loc", "--level", "12", "--size", "320x240",
               "-o", "OUT/p.png"],
}


class Determinism(Law):
    def outcome(self, command, name, *options, cwd=None, **process):
        """stdout without its clock, and the bytes of the output, from a folder of its own."""
        folder = self.path(name)
        os.makedirs(folder, exist_ok=True)
        os.chmod(folder, 0o777)
        words = [os.path.join(folder, word[4:]) if word.startswith("OUT/") else
                 self.path(word) if word == "ball.ply" else word for word in command]
        out = self.done(*words, "--json", *options, program=self.open_program(),
                        **({"cwd": cwd} if cwd else {}), **process)
        text = re.sub(rb'"seconds": [-+.e0-9]+', b'"seconds"', out).replace(folder.encode(), b"")
        files = {}
        for file in sorted(os.listdir(folder)):
            with open(os.path.join(folder, file), "rb") as data:
                files[file] = data.read()
            os.unlink(os.path.join(folder, file))
        return text, files

    def done(self, *arguments, **options):
        cwd = options.pop("cwd", self.folder)
        process = subprocess.run([options.pop("program"), *arguments], cwd=cwd, capture_output=True,
                                 stdin=subprocess.DEVNULL, timeout=600, **options)
        self.assertEqual(process.returncode, 0, (arguments, process.stderr))
        return process.stdout

    def setUp(self):
        super().setUp()
        self.done("synth", "surface", "--shape", "bumpy-sphere", "--vertices", "20000", "--noise",
                  "10", "-o", self.path("ball.ply"), program=self.open_program())

    def test_threads(self):
        for title, command in VERBS.items():
            one = self.outcome(command, "one", "--threads", "1")
            for threads in ("2", "8"):
                with self.subTest(title, threads=threads):
                    self.assertTrue(one == self.outcome(command, "more", "--threads", threads))

    def test_a_german_user_at_the_other_end_of_the_world_in_a_folder_that_cannot_be_written(self):
        locales = self.path("locale")
        os.mkdir(locales)
        made = subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8",
                               os.path.join(locales, "de_DE.UTF-8")], capture_output=True)
        self.assertIn(made.returncode, (0, 1), made.stderr)  # 1: done, with warnings
        german = {"PATH": os.environ["PATH"], "LC_ALL": "de_DE.UTF-8", "LANG": "de_DE.UTF-8",
                  "LOCPATH": locales, "TZ": "Pacific/Chatham"}  # no HOME
        for name in ("ASAN_OPTIONS", "UBSAN_OPTIONS"):
            if name in os.environ:
                german[name] = os.environ[name]
        comma = subprocess.run(["python3", "-c", "import locale; locale.setlocale(locale.LC_ALL, ''); "
                                "print(locale.localeconv()['decimal_point'])"],
                               env=german, capture_output=True, text=True, check=True).stdout
        self.assertEqual(comma, ",\n", "the locale is not really there")
        read_only = self.path("read-only")
        os.mkdir(read_only, 0o555)
        plain = {"PATH": os.environ["PATH"], "LC_ALL": "C", "HOME": self.folder}
        for title, command in VERBS.items():
            with self.subTest(title):
                self.assertTrue(self.outcome(command, "plain", env=plain) ==
                                self.outcome(command, "german", env=german, cwd=read_only,
                                             preexec_fn=become_nobody))


if __name__ == "__main__":
    unittest.main()
