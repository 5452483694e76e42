"""What the laws share: the program under test, and surfaces written byte by byte."""
import json
import math
import os
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

DUPIN = os.path.abspath(sys.argv.pop(1))


def run(folder, *arguments, **options):
    """Exit status, stdout and stderr (bytes) of the program in `folder`."""
    process = subprocess.run([options.pop("program", DUPIN), *arguments], cwd=folder,
                             stdin=subprocess.DEVNULL, stdout=options.pop("stdout", subprocess.PIPE),
                             stderr=subprocess.PIPE, timeout=600, **options)
    return process.returncode, process.stdout, process.stderr


def become_nobody():
    """Root may write everywhere; the laws about rights need somebody who may not."""
    if os.geteuid() == 0:
        os.setgroups([])
        os.setgid(65534)
        os.setuid(65534)


class Law(unittest.TestCase):
    """A test with a folder of its own that everybody may enter, and a copy of the program there."""

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        os.chmod(self.folder, 0o755)
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def path(self, *parts):
        return os.path.join(self.folder, *parts)

    def open_program(self):
        """The program where everybody may run it."""
        target = self.path("dupin-for-all")
        if not os.path.exists(target):
            shutil.copy(DUPIN, target)
            os.chmod(target, 0o755)
        return target

    def dupin(self, *arguments, **options):
        return run(self.folder, *arguments, **options)

    def done(self, *arguments, **options):
        status, out, err = self.dupin(*arguments, **options)
        self.assertEqual(status, 0, (arguments, err))
        return out

    def synth(self, name, *options):
        return json.loads(self.done("synth", "surface", "--json", "-o", name, *options))


def read_ply(path):
    """Points and triangles of a binary PLY that the program wrote (x y z first, then doubles)."""
    with open(path, "rb") as file:
        data = file.read()
    head, body = data.split(b"end_header\n", 1)
    sizes = {b"double": 8, b"float": 4, b"int": 4, b"uint": 4, b"uchar": 1}
    num_vertices = num_faces = stride = 0
    element = b""
    for line in head.split(b"\n"):
        words = line.split()
        if words[:1] == [b"element"]:
            element = words[1]
            if element == b"vertex":
                num_vertices = int(words[2])
            else:
                num_faces = int(words[2])
        elif words[:1] == [b"property"] and element == b"vertex":
            stride += sizes[words[1]]
    points = [struct.unpack_from("<3d", body, i * stride) for i in range(num_vertices)]
    faces = [struct.unpack_from("<3i", body, num_vertices * stride + 13 * i + 1)
             for i in range(num_faces)]
    return points, faces


def write_ply(path, points, faces):
    """A binary PLY in double: nothing is rounded."""
    with open(path, "wb") as out:
        out.write((f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
                   "property double x\nproperty double y\nproperty double z\n"
                   f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
                   "end_header\n").encode())
        for point in points:
            out.write(struct.pack("<3d", *point))
        for face in faces:
            out.write(struct.pack("<B3i", 3, *face))


__all__ = ["DUPIN", "Law", "become_nobody", "json", "math", "os", "random", "read_ply", "run", "struct",
           "write_ply"]
