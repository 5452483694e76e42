#!/usr/bin/env python3
"""`dupin warp new`, `contour`, `mesh` and `render`: the laws of warping as the whole program keeps them.

usage: warp_test.py DUPIN
"""
import hashlib
import json as json_module
import signal
import subprocess
import unittest
import zlib

from program import DUPIN, Law, become_nobody, json, math, os, struct

WIDTH, HEIGHT = 120, 90


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(pixels, depth=8, before=b"", colour=6):
    """A PNG of rows of (r, g, b, a); colour 2 leaves alpha out."""
    form, channels = ("B" if depth == 8 else "H"), (4 if colour == 6 else 3)
    rows = b"".join(b"\0" + struct.pack(f">{channels * len(row)}{form}", *[v for p in row for v in p[:channels]])
                    for row in pixels)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", len(pixels[0]), len(pixels), depth, colour, 0, 0, 0))
            + before + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def chunks_of(data):
    at, found = 8, []
    while at < len(data):
        size = struct.unpack_from(">I", data, at)[0]
        found.append((data[at + 4:at + 8], data[at + 8:at + 8 + size]))
        at += 12 + size
    return found


def read_png(path):
    """Rows of (r, g, b, a) and the depth of a PNG that the program wrote."""
    with open(path, "rb") as file:
        found = chunks_of(file.read())
    width, height, depth, colour = struct.unpack(">IIBB", found[0][1][:10])
    channels, size = (4 if colour == 6 else 3), depth // 8
    data = zlib.decompress(b"".join(body for kind, body in found if kind == b"IDAT"))
    stride, step, above, rows = width * channels * size, channels * size, bytes(width * channels * size), []
    for y in range(height):
        start = y * (stride + 1)
        kind, line = data[start], bytearray(data[start + 1:start + 1 + stride])
        for i in range(stride):
            left = line[i - step] if i >= step else 0
            corner = above[i - step] if i >= step else 0
            guess = left + above[i] - corner
            nearest = min((abs(guess - left), 0, left), (abs(guess - above[i]), 1, above[i]), (abs(guess - corner), 2, corner))
            line[i] = (line[i] + (0, left, above[i], (left + above[i]) // 2, nearest[2])[kind]) & 255
        above = bytes(line)
        values = struct.unpack(f">{width * channels}{'B' if depth == 8 else 'H'}", above)
        full = (2 ** depth - 1,) if channels == 3 else ()
        rows.append([values[i:i + channels] + full for i in range(0, len(values), channels)])
    return rows, depth


def read_map(path):
    """Shape and rows of (x, y) of an .npy of float32."""
    with open(path, "rb") as file:
        data = file.read()
    size = struct.unpack_from("<H", data, 8)[0]
    header = eval(data[10:10 + size])  # pylint: disable=eval-used
    assert header["descr"] == "<f4" and not header["fortran_order"], header
    values = struct.unpack_from(f"<{(len(data) - 10 - size) // 4}f", data, 10 + size)
    height, width, two = header["shape"]
    assert two == 2 and len(values) == 2 * width * height, header
    return [[values[2 * (y * width + x):2 * (y * width + x) + 2] for x in range(width)] for y in range(height)]


def in_disc(x, y):
    """A disc with a hole."""
    return 10 <= math.hypot(x + .5 - 45, y + .5 - 45) <= 38


def in_bar(x, y):
    return 100 <= x < 110 and 20 <= y < 70


def picture(inside, full=255):
    """A cut-out whose every pixel has a colour of its own; transparent ones are black."""
    return [[((x * 2 + 3 * y) % full, x, y, full) if inside(x, y) else (0, 0, 0, 0) for x in range(WIDTH)]
            for y in range(HEIGHT)]


def pin(x, y, to_x, to_y, **more):
    return {"source": [x, y], "target": [to_x, to_y], **more}


def pins_moved_by(right, down):
    return [pin(x, y, x + right, y + down) for x, y in ((20.3, 45.2), (70.1, 45.9), (45.5, 70.4), (45.2, 18.7))]


def without_times(value):
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if not k.startswith("seconds")}
    return [without_times(v) for v in value] if isinstance(value, list) else value


class WarpLaw(Law):
    def setUp(self):
        super().setUp()
        self.write("disc.png", png(picture(in_disc)))
        self.write("both.png", png(picture(lambda x, y: in_disc(x, y) or in_bar(x, y))))

    def write(self, name, content):
        with open(self.path(name), "wb") as file:
            file.write(content if isinstance(content, bytes) else content.encode())

    def read(self, name):
        with open(self.path(name), "rb") as file:
            return file.read()

    def new(self, name, image="disc.png", pins=None, *options):
        if pins is not None:
            self.write("pins.json", json.dumps(pins))
            options += ("--pins", "pins.json")
        return json.loads(self.done("warp", "new", image, "-o", name, "--json", *options))

    def render(self, name, *options):
        return json.loads(self.done("warp", "render", name, "-o", "out.png", "--json", *options))

    def refused(self, exit_code, code, *arguments, **options):
        """The program says so in text and in JSON, and leaves no output."""
        before = set(os.listdir(self.folder))
        status, out, err = self.dupin(*arguments, **options)
        self.assertEqual((status, out), (exit_code, b""), (arguments, err))
        self.assertIn(code.encode() + b": ", err)
        status, out, _ = self.dupin(*arguments, "--json", **options)
        error = json.loads(out)["error"]
        self.assertEqual((status, error["exit"], error["code"]), (exit_code, exit_code, code))
        self.assertEqual(set(os.listdir(self.folder)), before)
        return error

    def codes(self, document):
        return [warning["code"] for warning in document["warnings"]]


class Identity(WarpLaw):
    """A shape that no pin moves is the cut-out, pixel for pixel."""

    def test_without_pins(self):
        document = self.new("p.dwarp")
        self.assertEqual((document["pins"], document["components"], document["holes"]), (0, 1, 1))
        self.assertEqual(self.codes(document), [])
        self.assertLess(abs(document["triangles"] / 2500 - 1), .15)
        self.assertGreaterEqual(document["smallest_angle"], 25)
        rendered = self.render("p.dwarp", "--map", "map.npy")
        self.assertEqual(read_png(self.path("out.png")), (picture(in_disc), 8))
        self.assertEqual((rendered["flipped"], rendered["iterations"], rendered["energy"]), (0, 0, 0))
        self.assertEqual(rendered["triangles"], document["triangles"])
        for y, row in enumerate(read_map(self.path("map.npy"))):
            for x, (u, v) in enumerate(row):
                if in_disc(x, y):
                    self.assertEqual((u, v), (x + .5, y + .5))
                if math.hypot(x + .5 - 45, y + .5 - 45) > 42:
                    self.assertTrue(math.isnan(u) and math.isnan(v))

    def test_pins_at_rest(self):
        for method in ("arap", "mls", "image-mls"):
            self.new("p.dwarp", "disc.png", pins_moved_by(0, 0), "--method", method)
            self.render("p.dwarp")
            self.assertEqual(read_png(self.path("out.png"))[0], picture(in_disc))


class Motion(WarpLaw):
    def test_all_pins_by_whole_pixels_move_the_picture(self):
        self.new("p.dwarp", "disc.png", pins_moved_by(5, -3))
        document = self.render("p.dwarp")
        expected = [[picture(in_disc)[y + 3][x - 5] if y + 3 < HEIGHT and x >= 5 else (0, 0, 0, 0) for x in range(WIDTH)]
                    for y in range(HEIGHT)]
        self.assertEqual(read_png(self.path("out.png"))[0], expected)
        self.assertLess(abs(document["area_change"]), 1e-9)

    def test_one_pin_moves_the_picture_too(self):
        self.new("p.dwarp", "disc.png", [pin(30, 45, 31, 45)])
        self.render("p.dwarp")
        self.assertEqual(read_png(self.path("out.png"))[0][45][31], picture(in_disc)[45][30])

    def test_fields_of_a_bent_shape(self):
        pins = pins_moved_by(0, 0)
        pins[0]["target"] = [12, 25]
        pins[0]["name"] = "left"
        self.new("p.dwarp", "disc.png", pins)
        document = self.render("p.dwarp", "--map", "map.npy", "--pins-picture", "pins.png")
        self.assertLessEqual({"triangles", "flipped", "iterations", "energy", "seconds_per_iteration", "stages", "stretch",
                              "area_change", "bounds", "warnings"}, set(document))
        self.assertEqual((document["iterations"], document["flipped"]), (10, 0))
        stage = document["stages"][0]
        self.assertEqual((stage["mode"], stage["pins"], len(stage["energy"])), ("coarse", 4, 11))
        self.assertEqual(stage["energy"], sorted(stage["energy"], reverse=True))
        self.assertEqual(stage["energy"][-1], document["energy"])
        self.assertLess(stage["largest_violation"], 1e-6)
        # The pin interpolates: the output pixel at the target shows the source.
        u, v = read_map(self.path("map.npy"))[25][12]
        self.assertLess(math.hypot(u - 20.8, v - 45.7), 1.5)
        self.assertEqual(len(read_png(self.path("pins.png"))[0]), HEIGHT)
        other = self.render("p.dwarp", "--method", "mls")
        self.assertEqual(other["iterations"], 0)

    def test_a_part_without_pins_stays_and_is_told(self):
        document = self.new("p.dwarp", "both.png", pins_moved_by(5, 0), "--all-components")
        self.assertEqual(document["components"], 2)
        self.assertIn("W_COMPONENT_UNANCHORED", self.codes(document))
        rendered = self.render("p.dwarp")
        self.assertIn("W_COMPONENT_UNANCHORED", self.codes(rendered))
        self.assertEqual(rendered["stages"][0]["unanchored_components"], [1])
        rows = read_png(self.path("out.png"))[0]
        self.assertEqual(rows[45][105], picture(in_bar)[45][105])
        self.assertEqual(rows[45][25], picture(in_disc)[45][20])
        self.refused(5, "E_COMPONENT_UNANCHORED", "warp", "render", "p.dwarp", "-o", "none.png", "--require-anchored")
        self.refused(4, "W_COMPONENTS", "warp", "render", "p.dwarp", "-o", "none.png", "--strict", "--quiet")

    def test_exterior_pins_move_the_contour(self):
        corners = [(45 + 41 * math.cos(a * math.pi / 4), 45 + 41 * math.sin(a * math.pi / 4)) for a in range(8)]
        pins = [pin(x, y, x + (10 if i == 0 else 0), y, kind="exterior") for i, (x, y) in enumerate(corners)]
        self.new("p.dwarp", "disc.png", pins)
        document = self.render("p.dwarp")
        self.assertEqual(document["stages"][0]["mode"], "fine")
        rows = read_png(self.path("out.png"))[0]
        self.assertGreater(rows[45][89][3], 127)  # 6 pixels beyond the disc
        self.assertEqual(rows[45][5][3], 0)


    def test_exterior_pins_are_carried_with_the_shape(self):
        """All interior pins moved by (5, -3), exterior ones on top of that: sources follow (7.31 to 7.33)."""
        corners = [(45 + 41 * math.cos(a * math.pi / 4), 45 + 41 * math.sin(a * math.pi / 4)) for a in range(8)]
        pins = pins_moved_by(5, -3) + [pin(x, y, x + 5, y - 3, kind="exterior") for x, y in corners]
        self.new("p.dwarp", "disc.png", pins)
        stages = json.loads(self.read("p.dwarp"))["stages"]
        self.assertEqual([stage["mode"] for stage in stages], ["coarse", "fine"])
        for (x, y), carried in zip(corners, stages[1]["pins"]):
            self.assertLess(math.hypot(carried["source"][0] - x - 5, carried["source"][1] - y + 3), 1e-4)
        self.render("p.dwarp")
        self.assertEqual(read_png(self.path("out.png"))[0][42][25], picture(in_disc)[45][20])


class Sameness(WarpLaw):
    def test_same_bytes_for_every_run_and_thread_count(self):
        pins = pins_moved_by(0, 0)
        pins[1]["target"], pins[1]["rotation"], pins[2]["depth"] = [78, 30], 20, 3
        results = set()
        for threads in ("1", "2", "2"):
            document = self.new("p.dwarp", "both.png", pins, "--all-components", "--threads", threads)
            outputs = [json.dumps(without_times(document)), self.read("p.dwarp")]
            rendered = self.render("p.dwarp", "--map", "map.npy", "--pins-picture", "pins.png", "--threads", threads)
            outputs += [json.dumps(without_times(rendered))]
            outputs += [self.read(name) for name in ("out.png", "map.npy", "pins.png")]
            for name in ("mesh.obj", "mesh.ply", "mesh.off", "mesh.png", "mesh.svg"):
                self.done("warp", "mesh", "p.dwarp", "-o", name, "--threads", threads)
                outputs.append(self.read(name))
            for name in ("loops.json", "loops.svg", "loops.png"):
                self.done("warp", "contour", "p.dwarp", "-o", name, "--threads", threads)
                outputs.append(self.read(name))
            results.add(tuple(hashlib.sha256(o if isinstance(o, bytes) else o.encode()).hexdigest() for o in outputs))
        self.assertEqual(len(results), 1)

    def test_a_project_moves_with_its_picture(self):
        os.mkdir(self.path("a"))
        os.mkdir(self.path("a", "projects"))
        os.rename(self.path("disc.png"), self.path("a", "disc.png"))
        self.done("warp", "new", "a/disc.png", "-o", "a/projects/p.dwarp")
        self.assertEqual(json.loads(self.read("a/projects/p.dwarp"))["image"]["path"], "../disc.png")
        os.rename(self.path("a"), self.path("b"))
        self.render("b/projects/p.dwarp")
        self.assertEqual(read_png(self.path("out.png"))[0], picture(in_disc))

    def test_a_project_comes_through_standard_input(self):
        self.new("p.dwarp")
        process = subprocess.run([DUPIN, "warp", "render", "-", "-o", "out.png"], cwd=self.folder, input=self.read("p.dwarp"),
                                 capture_output=True, check=False)
        self.assertEqual(process.returncode, 0, process.stderr)
        self.assertEqual(read_png(self.path("out.png"))[0], picture(in_disc))


class Pictures(WarpLaw):
    def test_depth_and_profile_are_kept(self):
        icc = bytearray(132)
        icc[:4], icc[16:20], icc[36:40] = struct.pack(">I", 132), b"RGB ", b"acsp"
        profile = b"sixteen\0\0" + zlib.compress(bytes(icc))
        self.write("deep.png", png(picture(in_disc, 65535), 16, chunk(b"iCCP", profile)))
        document = self.new("p.dwarp", "deep.png")
        self.assertEqual(document["image"]["bit_depth"], 16)
        self.assertEqual(self.render("p.dwarp")["bit_depth"], 16)
        self.assertEqual(read_png(self.path("out.png")), (picture(in_disc, 65535), 16))
        profiles = [[zlib.decompress(body.split(b"\0\0", 1)[1]) for kind, body in chunks_of(self.read(name)) if kind == b"iCCP"]
                    for name in ("deep.png", "out.png")]
        self.assertEqual(len(profiles[0]), 1)
        self.assertEqual(profiles[0], profiles[1])

    def test_a_background_gives_the_size_and_shows_behind(self):
        self.write("back.png", png([[(9, 8, 7, 255)] * 200 for _ in range(70)]))
        self.new("p.dwarp")
        document = self.render("p.dwarp", "--background", "back.png")
        self.assertEqual((document["width"], document["height"]), (200, 70))
        rows = read_png(self.path("out.png"))[0]
        self.assertEqual(rows[5][190], (9, 8, 7, 255))
        self.assertEqual(rows[45][20], picture(in_disc)[45][20])

    def test_a_scale_gives_a_larger_picture(self):
        self.new("p.dwarp")
        document = self.render("p.dwarp", "--scale", "1.5", "--map", "map.npy")
        self.assertEqual((document["width"], document["height"]), (180, 135))
        u, v = read_map(self.path("map.npy"))[60][30]
        self.assertAlmostEqual(u, 30.5 / 1.5, 4)
        self.assertAlmostEqual(v, 60.5 / 1.5, 4)

    def test_the_contour_can_be_drawn_again(self):
        document = json.loads(self.done("warp", "contour", "both.png", "-o", "loops.json", "--json"))
        self.assertEqual([loop["hole"] for loop in document["loops"]], [False, True])
        loops = json_module.loads(self.read("loops.json"))
        self.assertEqual([len(loop) for loop in loops], [loop["corners"] for loop in document["loops"]])
        drawn = self.new("p.dwarp", "both.png", None, "--contour", "loops.json")
        self.assertLess(abs(drawn["area"] / document["area"] - 1), .005)
        self.assertEqual(drawn["holes"], 1)

    def test_parts_that_are_left_out_are_told(self):
        document = self.new("p.dwarp", "both.png")
        self.assertEqual(document["components_left_out"], {"count": 1, "area": 500})
        self.assertIn("W_COMPONENTS", self.codes(document))
        self.assertEqual(self.new("p.dwarp", "both.png", None, "--all-components")["components"], 2)
        self.assertEqual(self.new("p.dwarp", "disc.png", None, "--no-holes")["holes"], 0)

    def test_meshes_are_what_the_json_says(self):
        document = self.new("p.dwarp", "disc.png", None, "--density", "fewer")
        made = json.loads(self.done("warp", "mesh", "p.dwarp", "-o", "m.obj", "--json"))
        self.assertEqual(made["triangles"], document["triangles"])
        lines = self.read("m.obj").decode().splitlines()
        self.assertEqual(sum(line.startswith("f ") for line in lines), document["triangles"])
        self.assertEqual(sum(line.startswith("v ") for line in lines), document["vertices"])
        more = self.new("p.dwarp", "disc.png", None, "--density", "4000")
        self.assertLess(abs(more["triangles"] / 4000 - 1), .15)
        self.assertIn(b"<image ", self.svg("mesh"))
        self.assertEqual(self.svg("contour").count(b"<path "), 1)

    def svg(self, verb):
        self.done("warp", verb, "p.dwarp", "-o", "x.svg")
        return self.read("x.svg")


class Interruption(WarpLaw):
    def test_leaves_all_outputs_or_none(self):
        width, height = 2400, 2000
        inside = b"".join(bytes((x % 256, x // 16, 7, 255)) for x in range(width - 40))
        row = b"\0" + b"\0" * 80 + inside + b"\0" * 80
        rows = (b"\0" * (4 * width + 1)) * 20 + row * (height - 20)
        self.write("big.png", b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b""))
        self.new("p.dwarp", "big.png", [pin(1500, 500, 1400, 700), pin(1500, 1500, 1500, 1500)])
        before = set(os.listdir(self.folder))
        outputs = {"out.png", "map.npy", "pins.png"}
        ends = []
        for delay in (.05, .2, .5, 1, 2, 4, 8, 16):
            process = subprocess.Popen([DUPIN, "warp", "render", "p.dwarp", "-o", "out.png", "--map", "map.npy", "--pins-picture",
                                        "pins.png"], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            try:
                process.communicate(timeout=delay)
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=120)
            ends.append(process.returncode)
            self.assertIn(process.returncode, (0, 130))
            found = set(os.listdir(self.folder)) - before
            self.assertEqual(found, outputs if process.returncode == 0 else set())
            if process.returncode == 0:
                break
        self.assertEqual(ends[0], 130, "the run is too short to be interrupted")


class BadPictures(WarpLaw):
    """Rows 20 to 22 of the contract."""

    def new_is_refused(self, exit_code, code, data, *options):
        self.write("bad.png", data)
        return self.refused(exit_code, code, "warp", "new", "bad.png", "-o", "none.dwarp", *options)

    def test_pictures_without_a_shape(self):
        self.new_is_refused(5, "E_NO_ALPHA", png(picture(lambda x, y: True)))
        self.new_is_refused(5, "E_NO_ALPHA", png(picture(lambda x, y: True), colour=2))
        self.new_is_refused(5, "E_EMPTY_SHAPE", png(picture(lambda x, y: False)))
        self.new_is_refused(5, "E_SHAPE_TOO_SMALL", png(picture(lambda x, y: (x, y) == (40, 40))))

    def test_damaged_pictures(self):
        data = png(picture(in_disc))
        self.new_is_refused(4, "E_CRC", data[:100] + bytes([data[100] ^ 1]) + data[101:])
        self.new_is_refused(4, "E_TRUNCATED", data[:len(data) // 2])
        self.new_is_refused(4, "E_MAGIC", b"<html>")
        self.new_is_refused(4, "E_EMPTY", b"")
        huge = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 65535, 65535, 8, 6, 0, 0, 0))
        self.new_is_refused(6, "E_IMAGE_TOO_LARGE", huge + chunk(b"IDAT", b"x" * 40) + chunk(b"IEND", b""))
        self.new_is_refused(6, "E_IMAGE_TOO_LARGE", data, "--max-image-pixels", "1000")

    def test_pictures_that_cannot_be_opened(self):
        self.refused(3, "E_NOT_FOUND", "warp", "new", "absent.png", "-o", "none.dwarp")
        self.refused(3, "E_NOT_A_FILE", "warp", "new", ".", "-o", "none.dwarp")
        os.mkfifo(self.path("fifo"))
        self.refused(3, "E_NOT_A_FILE", "warp", "new", "fifo", "-o", "none.dwarp")


class BadPins(WarpLaw):
    """Row 23 of the contract."""

    def pins_are_refused(self, exit_code, code, pins, *options):
        self.write("bad.json", pins if isinstance(pins, str) else json.dumps(pins))
        return self.refused(exit_code, code, "warp", "new", "disc.png", "-o", "none.dwarp", "--pins", "bad.json", *options)

    def test_pins_that_are_nowhere(self):
        error = self.pins_are_refused(5, "E_PIN_OUTSIDE", [pin(3, 3, 9, 9, name="hem")])
        self.assertIn("hem", error["message"])
        self.assertEqual(error["file"], "bad.json")
        self.pins_are_refused(5, "E_PIN_OUTSIDE", pins_moved_by(0, 0) + [pin(45, 45, 45, 45)])  # in the hole
        self.pins_are_refused(5, "E_PIN_CONFLICT", [pin(30, 45, 30, 45), pin(30, 45, 40, 45)])
        self.pins_are_refused(4, "E_NUMBER_RANGE", [pin(1e9, 0, 0, 0)])
        self.pins_are_refused(4, "E_SYNTAX", '[{"source": [NaN, 0], "target": [0, 0]}]')
        self.pins_are_refused(4, "E_SYNTAX", '[{"source": [30, 45]}]')
        self.pins_are_refused(4, "E_SYNTAX", '[{"source": [30, 45], "target": [0, 0], "colour": 1}]')
        self.pins_are_refused(4, "E_TRUNCATED", '[{"source": [30, 45]')
        self.pins_are_refused(4, "E_EMPTY", "")
        self.pins_are_refused(6, "E_TOO_LARGE", [pin(30, 45, 30, 45)] * 10001)

    def test_more_than_a_computer_holds_is_refused(self):
        grid = [(.85 * i + .1, .85 * k + .1) for i in range(100) for k in range(100)]
        pins = [pin(x, y, x, y) for x, y in grid if 11 < math.hypot(x - 45, y - 45) < 37]
        self.assertGreater(len(pins), 5000)
        self.pins_are_refused(6, "E_TOO_LARGE", pins, "--density", "900000")

    def test_extreme_pins_leave_numbers_finite(self):
        for extreme in ({"target": [1e6, -1e6]}, {"rotation": 36000}, {"weight": 1e6}, {"weight": 1e-6}, {"radius": 1e6}, {"depth": 1e6},
                        {"depth": -1e6, "radius": 5, "rotation": 179}):
            pins = pins_moved_by(0, 0)
            pins[0].update(extreme)
            self.new("p.dwarp", "disc.png", pins)
            for method in ("arap", "image-mls"):
                text = json.dumps(self.render("p.dwarp", "--method", method))
                self.assertEqual(text.count("null") + text.count("NaN") + text.count("Infinity"), 0, extreme)

    def test_repeated_pins_are_told(self):
        document = self.new("p.dwarp", "disc.png", [pin(30, 45, 32, 45)] * 2)
        self.assertIn("W_PIN_REPEATED", self.codes(document))

    def test_none_is_no_error(self):
        self.assertEqual(self.new("p.dwarp", "disc.png", [])["pins"], 0)

    def test_fold_overs_are_counted(self):
        pins = [pin(20, 45, 70, 45), pin(70, 45, 20, 45), pin(45, 20, 45, 20), pin(45, 70, 45, 70)]
        self.new("p.dwarp", "disc.png", pins)
        document = self.render("p.dwarp", "--method", "mls")
        self.assertEqual("W_FOLD_OVER" in self.codes(document), document["flipped"] > 0)
        self.assertGreater(document["flipped"], 0)

    def test_contours_that_cross(self):
        def contour(exit_code, code, text):
            self.write("bad.json", text)
            return self.refused(exit_code, code, "warp", "new", "disc.png", "-o", "none.dwarp", "--contour", "bad.json")
        error = contour(5, "E_OUTLINE_CROSSED", "[[10, 10], [80, 80], [80, 10], [10, 80]]")
        self.assertIn("(45, 45)", error["message"])
        contour(5, "E_OUTLINE_CROSSED", "[[[10, 10], [80, 10], [10, 80]], [[20, 20], [90, 20], [20, 30]]]")
        contour(5, "E_SHAPE_TOO_SMALL", "[[1, 1], [1, 1], [2, 2], [2, 2]]")
        contour(4, "E_SYNTAX", "[[1, 1], [2, 2]]")
        self.write("good.json", "[[10, 10], [80, 10], [10, 80]]")
        self.refused(2, "E_OPTION", "warp", "new", "disc.png", "-o", "none.dwarp", "--contour", "good.json", "--expansion", "1")


class BadProjects(WarpLaw):
    def setUp(self):
        super().setUp()
        self.new("p.dwarp", "disc.png", pins_moved_by(1, 0))
        self.text = self.read("p.dwarp").decode()

    def project_is_refused(self, exit_code, code, text, verb="render"):
        self.write("bad.dwarp", text)
        return self.refused(exit_code, code, "warp", verb, "bad.dwarp", "-o", "none.png")

    def test_changed_and_newer_projects(self):
        self.project_is_refused(4, "E_CRC", self.text.replace('"iterations": 10', '"iterations": 11'))
        self.project_is_refused(4, "E_VERSION", self.text.replace('"version": 1', '"version": 2'))
        self.project_is_refused(4, "E_MAGIC", "{}")
        self.project_is_refused(4, "E_TRUNCATED", self.text[:300])
        self.project_is_refused(4, "E_SYNTAX", self.text.replace('"beta"', '"gamma"'))
        self.write("bad.dwarp", self.text.split(',\n  "checksum"')[0].replace('"iterations": 10', '"iterations": 11') + "}")
        self.assertEqual(self.render("bad.dwarp")["iterations"], 11)
        for verb in ("mesh", "contour"):
            self.project_is_refused(4, "E_CRC", self.text.replace('"iterations": 10', '"iterations": 11'), verb)

    def test_changed_pictures(self):
        self.write("disc.png", self.read("disc.png") + b"x")
        error = self.refused(5, "E_IMAGE_CHANGED", "warp", "render", "p.dwarp", "-o", "none.png")
        self.assertIn("SHA-256", error["hint"])
        self.assertEqual(error["file"], "disc.png")
        os.remove(self.path("disc.png"))
        self.refused(3, "E_NOT_FOUND", "warp", "render", "p.dwarp", "-o", "none.png")

    def test_another_size_than_the_project_says(self):
        body = self.text.split(',\n  "checksum"')[0] + "}"
        self.project_is_refused(5, "E_IMAGE_CHANGED", body.replace(f'"width": {WIDTH}', f'"width": {WIDTH + 1}'))

    def test_files_that_cannot_be_opened(self):
        self.refused(3, "E_NOT_FOUND", "warp", "render", "absent.dwarp", "-o", "none.png")
        self.refused(3, "E_NOT_FOUND", "warp", "render", "p.dwarp", "-o", "none.png", "--background", "absent.png")


class BadOptions(WarpLaw):
    """Rows 24 and 25 of the contract."""

    def setUp(self):
        super().setUp()
        self.new("p.dwarp")

    def test_options_out_of_range(self):
        for option in (("--density", "15"), ("--density", "many"), ("--expansion", "-1"), ("--expansion", "257"), ("--expansion", "nan"),
                       ("--alpha-threshold", "1"), ("--alpha-threshold", "-0.1"), ("--method", "cage"), ("--threads", "0")):
            self.refused(2, "E_OPTION", "warp", "new", "disc.png", "-o", "none.dwarp", *option)
        self.refused(2, "E_OPTION", "warp", "new", "disc.png", "-o", "none.json")
        for option in (("--scale", "0"), ("--scale", "65"), ("--method", "cage"), ("--map", "map.txt"), ("--map", "-"),
                       ("--pins-picture", "none.png")):
            self.refused(2, "E_OPTION", "warp", "render", "p.dwarp", "-o", "none.png", *option)
        self.refused(2, "E_OPTION", "warp", "render", "p.dwarp", "-o", "none.jpg")
        self.refused(2, "E_OPTION", "warp", "mesh", "p.dwarp", "-o", "none.stl")
        self.refused(2, "E_OPTION", "warp", "contour", "p.dwarp", "-o", "none.obj")
        self.refused(2, "E_OPTION", "warp")

    def test_inputs_are_never_overwritten(self):
        before = self.read("disc.png")
        self.refused(2, "E_OPTION", "warp", "render", "p.dwarp", "-o", "disc.png")
        self.refused(2, "E_OPTION", "warp", "mesh", "p.dwarp", "-o", "./disc.png")
        self.assertEqual(self.read("disc.png"), before)

    def test_any_output_may_be_left_out(self):
        for options in ([], ["--map", "m.npy"], ["--pins-picture", "pins.png"], ["--map", "m.npy", "--pins-picture", "pins.png"]):
            self.render("p.dwarp", *options)
            for name in options[1::2]:
                os.remove(self.path(name))

    def test_two_outputs_are_two_files(self):
        self.refused(2, "E_OPTION", "warp", "render", "p.dwarp", "-o", "new.png", "--pins-picture", "./new.png")

    def test_a_picture_is_no_project(self):
        self.assertIn("warp new", self.refused(4, "E_MAGIC", "warp", "render", "disc.png", "-o", "new.png")["hint"])

    def test_a_byte_order_mark_is_skipped(self):
        self.write("q.dwarp", b"\xef\xbb\xbf" + self.read("p.dwarp"))
        self.render("q.dwarp")

    def test_too_large_an_output(self):
        self.refused(6, "E_IMAGE_TOO_LARGE", "warp", "render", "p.dwarp", "-o", "none.png", "--scale", "64", "--max-image-pixels", "100000")

    def test_outputs_that_cannot_be_written(self):
        os.mkdir(self.path("folder.png"))
        os.mkdir(self.path("folder.dwarp"))
        self.refused(7, "E_WRITE", "warp", "new", "disc.png", "-o", "folder.dwarp")
        self.refused(7, "E_WRITE", "warp", "render", "p.dwarp", "-o", "folder.png")
        self.refused(7, "E_WRITE", "warp", "render", "p.dwarp", "-o", "none.png", "--map", "nowhere/map.npy")
        self.refused(7, "E_WRITE", "warp", "mesh", "p.dwarp", "-o", "nowhere/mesh.obj")
        self.refused(7, "E_WRITE", "warp", "contour", "p.dwarp", "-o", "nowhere/loops.json")
        self.refused(7, "E_WRITE", "warp", "render", "p.dwarp", "-o", "none.png", program=self.open_program(),
                     preexec_fn=become_nobody)


if __name__ == "__main__":
    unittest.main()
