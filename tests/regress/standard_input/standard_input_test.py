#!/usr/bin/env python3
"""A silent standard input is left by --timeout and by a signal; both were ignored.

usage: standard_input_test.py DUPIN
"""
import signal
import subprocess
import time
import unittest

from program import DUPIN, Law

# The program waits 0.1 s at a time; the rest is for a slow machine.
ALLOWED = 2.0


class StandardInput(Law):
    def waiting(self, *arguments):
        return subprocess.Popen([DUPIN, "check", "-", *arguments], cwd=self.folder,
                                stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE)

    def end(self, process, start):
        """Exit status of a process that gets nothing to read."""
        try:
            status = process.wait(timeout=ALLOWED)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            status = None
        self.assertLess(time.monotonic() - start, ALLOWED + 1.0)
        for stream in (process.stdin, process.stdout, process.stderr):
            stream.close()
        return status

    def test_a_signal_ends_it(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            process = self.waiting()
            process.stdin.write(b"ply\n")
            process.stdin.flush()
            time.sleep(0.3)
            process.send_signal(number)
            self.assertEqual(self.end(process, time.monotonic()), 128 + number)

    def test_the_timeout_ends_it(self):
        start = time.monotonic()
        self.assertEqual(self.end(self.waiting("--timeout", "0.2"), start), 6)


if __name__ == "__main__":
    unittest.main()
