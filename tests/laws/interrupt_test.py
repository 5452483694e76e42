#!/usr/bin/env python3
"""Ctrl-C ends a long run at once, with exit status 130 (143 for SIGTERM) and nothing left
behind (G3, G6).

usage: interrupt_test.py DUPIN [SECONDS]     SECONDS: longest wait from signal to exit (0.5)
"""
import signal
import subprocess
import sys
import time
import unittest

from program import DUPIN, Law, json, os

ALLOWED = float(sys.argv.pop(1)) if len(sys.argv) > 1 else 0.5
MILLION = 1_000_000


class Interrupt(Law):
    def interrupted(self, delay, number, *arguments):
        """Seconds from signal to exit, status and stdout; None if the run was over before."""
        process = subprocess.Popen([DUPIN, *arguments], cwd=self.folder, stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        try:
            out, err = process.communicate(timeout=delay)
            self.assertEqual(process.returncode, 0, err)
            return None
        except subprocess.TimeoutExpired:
            pass
        start = time.monotonic()
        process.send_signal(number)
        out, err = process.communicate(timeout=120)
        return time.monotonic() - start, process.returncode, out, err

    def test_a_stack_of_a_million_vertices(self):
        self.synth("big.ply", "--shape", "sphere", "--vertices", str(MILLION))
        before = sorted(os.listdir(self.folder))
        waits = []
        for delay in (0.15, 0.6, 1.5, 3.0, 6.0):
            number = signal.SIGTERM if delay == 0.6 else signal.SIGINT
            ended = self.interrupted(delay, number, "scalespace", "big.ply", "-o", "stack.npz",
                                     "--json")
            if ended is None:
                break
            seconds, status, out, err = ended
            waits.append((delay, round(seconds, 3)))
            self.assertEqual(status, 128 + number, err)
            self.assertEqual(json.loads(out)["error"]["code"], "E_INTERRUPTED")
            self.assertEqual(json.loads(out)["error"]["exit"], status)
            self.assertEqual(sorted(os.listdir(self.folder)), before)
        print("signal after, exit after [s]:", waits)
        self.assertGreaterEqual(len(waits), 2, "the run is too short to be interrupted")
        self.assertLessEqual(max(seconds for _, seconds in waits), ALLOWED, waits)

    def test_a_surface_in_the_making(self):
        waits = []
        for delay in (0.1, 0.5, 1.2, 2.5):
            ended = self.interrupted(delay, signal.SIGINT, "synth", "surface", "--shape", "bumpy-sphere",
                                     "--vertices", str(3 * MILLION), "-o", "big.ply", "--json")
            if ended is None:
                break
            seconds, status, out, err = ended
            waits.append((delay, round(seconds, 3)))
            self.assertEqual(status, 130, err)
            self.assertEqual(json.loads(out)["error"]["code"], "E_INTERRUPTED")
            self.assertEqual(os.listdir(self.folder), [])
        print("signal after, exit after [s]:", waits)
        self.assertGreaterEqual(len(waits), 2, "the run is too short to be interrupted")
        self.assertLessEqual(max(seconds for _, seconds in waits), ALLOWED, waits)

    def test_views_leave_no_folder_of_half_a_set(self):
        self.synth("body.ply", "--shape", "bumpy-sphere", "--vertices", "40000")
        os.mkdir(self.path("views"))
        # What a process that is no more left there goes too; what does not bear our name stays.
        gone = subprocess.Popen(["true"])
        gone.wait()
        os.mkdir(self.path(f"views/.unfinished-{gone.pid}-0"))
        os.mkdir(self.path("views/.unfinished-notes"))
        num_waits = 0
        for delay in (0.4, 0.8, 1.6, 3.2):
            ended = self.interrupted(delay, signal.SIGINT, "synth", "views", "body.ply", "-o", "views", "--count", "36",
                                     "--rows", "1200", "--cols", "1200", "--json")
            if ended is None:
                break
            seconds, status, out, err = ended
            num_waits += 1
            self.assertEqual(status, 130, err)
            self.assertLessEqual(seconds, ALLOWED)
            self.assertEqual(os.listdir(self.path("views")), [".unfinished-notes"])
        self.assertGreaterEqual(num_waits, 2, "the run is too short to be interrupted")


if __name__ == "__main__":
    unittest.main()
