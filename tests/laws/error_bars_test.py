#!/usr/bin/env python3
"""`dupin mls scale` and the error bars of `dupin keypoints` as users meet them: units, threads, fields, thresholds.

usage: error_bars_test.py DUPIN
"""
import unittest

from program import Law, json, os, read_ply, struct, write_ply

POINT = {"vertex", "position", "normal", "level", "tau", "radius", "response", "kind", "persistence", "snr", "p_value",
         "position_sd", "radius_sd", "stability"}


def read_npy(path):
    """Numbers of a one-dimensional .npy of doubles."""
    with open(path, "rb") as file:
        data = file.read()
    start = 10 + struct.unpack_from("<H", data, 8)[0]
    return [x for x, in struct.iter_unpack("<d", data[start:])]


class ErrorBars(Law):
    def json_of(self, *words, status=0):
        code, out, err = self.dupin(*words, "--json", "--quiet")
        self.assertEqual(code, status, (words, err))
        return json.loads(out)

    def scaled(self, source, target, factor):
        points, faces = read_ply(self.path(source))
        write_ply(self.path(target), [tuple(factor * x for x in p) for p in points], faces)

    def near(self, found, wanted, share):
        self.assertEqual(found is None, wanted is None)
        if wanted is not None:
            self.assertLessEqual(abs(found - wanted), share * abs(wanted))


class Scale(ErrorBars):
    FEW = ["--samples", "6", "--experiments", "2", "--realisations", "35"]

    def setUp(self):
        super().setUp()
        # A tenth of an edge of noise: a regular surface has neighbours that are equally near, and rounding chooses.
        self.synth("t.ply", "--shape", "torus", "--vertices", "3000", "--noise", "10")

    def test_the_answer_has_the_fields_that_are_promised(self):
        answer = self.json_of("mls", "scale", "t.ply", "--noise", "0.02", *self.FEW)
        self.assertEqual(list(answer), ["points", "sigma", "sigma_is_estimated", "passed", "warnings"])
        self.assertEqual(len(answer["points"]), 6)
        for point in answer["points"]:
            self.assertEqual(list(point), ["vertex", "neighbors", "radius", "T_beta", "T_kappa", "passed"])
        self.assertEqual(answer["passed"], sum(point["passed"] for point in answer["points"]))
        self.assertEqual((answer["sigma"], answer["sigma_is_estimated"]), (0.02, False))
        alone = self.json_of("mls", "scale", "t.ply", "--noise", "0.02", "--vertex",
                             str(answer["points"][2]["vertex"]), *self.FEW)
        self.assertEqual(alone["points"], [answer["points"][2]])

    def test_the_unit_of_length_scales_the_radius_and_nothing_else(self):
        plain = self.json_of("mls", "scale", "t.ply", "--noise", "0.02", *self.FEW)
        self.assertGreater(plain["passed"], 0)
        for factor in (0.001, 10.0):
            self.scaled("t.ply", "s.ply", factor)
            scaled = self.json_of("mls", "scale", "s.ply", "--noise", repr(0.02 * factor), *self.FEW)
            for a, b in zip(plain["points"], scaled["points"]):
                self.assertEqual([a[k] for k in ("vertex", "neighbors", "passed")],
                                 [b[k] for k in ("vertex", "neighbors", "passed")])
                self.near(b["radius"], factor * a["radius"], 1e-9)
                # The coordinates are rounded anew: 1e-16 of the extent, against deviations of 1e-3 of it that are
                # standardised and inverted with a condition of up to 1e8.
                self.near(b["T_beta"], a["T_beta"], 1e-4)
                self.near(b["T_kappa"], a["T_kappa"], 1e-4)

    def test_every_number_of_threads_writes_the_same_bytes(self):
        written = set()
        for threads in "12":
            out = self.done("mls", "scale", "t.ply", "--noise", "0.02", *self.FEW, "--threads", threads, "--json", "-o",
                            "out.ply", "--field", "radius=radius.npy", "--field", "T_kappa=t.npy")
            files = []
            for name in ("out.ply", "radius.npy", "t.npy"):
                with open(self.path(name), "rb") as file:
                    files.append(file.read())
                os.remove(self.path(name))
            written.add((out, *files))
        self.assertEqual(len(written), 1)

    def test_a_field_has_the_values_of_the_answer_and_is_minus_one_where_no_size_passes(self):
        for noise, some_pass in (("0.02", True), ("0.3", False)):
            answer = self.json_of("mls", "scale", "t.ply", "--noise", noise, *self.FEW, "--sizes", "40,60,80",
                                  *(w for k in ("neighbors", "radius", "T_beta", "T_kappa")
                                    for w in ("--field", f"{k}={k}.npy")))
            self.assertEqual(answer["passed"] > 0, some_pass)
            fields = {k: read_npy(self.path(f"{k}.npy")) for k in ("neighbors", "radius", "T_beta", "T_kappa")}
            for point in answer["points"]:
                for name, values in fields.items():
                    self.assertEqual(len(values), len(read_ply(self.path("t.ply"))[0]))
                    is_size = name in ("neighbors", "radius")
                    self.assertEqual(values[point["vertex"]], -1 if is_size and not point["passed"] else point[name])
            # What is between has the value of a vertex that was tested.
            tested = {point["vertex"] for point in answer["points"]}
            self.assertEqual(set(fields["T_beta"]), {fields["T_beta"][v] for v in tested})
        drawn = self.json_of("render", "t.ply", "-o", "p.png", "--color", "radius.npy", "--no-value", "-1", "--size",
                             "64x48")
        self.assertEqual(len(drawn["range"]), 2)

    def test_more_noise_needs_more_neighbours_in_the_mean(self):
        means = []
        for noise in ("0.005", "0.015", "0.03"):
            points = self.json_of("mls", "scale", "t.ply", "--noise", noise, *self.FEW)["points"]
            means.append(sum(point["neighbors"] for point in points))
        self.assertEqual(means, sorted(means))
        self.assertGreater(means[-1], means[0])

    def test_what_the_numbers_do_not_tell_is_a_warning(self):
        def codes(*words):
            return {w["code"] for w in self.json_of("mls", "scale", "t.ply", *self.FEW, *words)["warnings"]}
        self.assertIn("W_NOISE_TWICE", codes("--noise", "auto"))
        self.assertNotIn("W_NOISE_TWICE", codes("--noise", "0.02"))
        self.assertIn("W_SIZE_DROPPED", codes("--noise", "0.02", "--sizes", "40,60,100000"))
        self.assertNotIn("W_SIZE_DROPPED", codes("--noise", "0.02", "--sizes", "40,60"))

    def test_wrong_options_are_wrong_usage(self):
        for words in (["--noise", "-1"], ["--noise", "0"], ["--noise", "nan"], ["--noise", "much"], ["--sizes", "40,40"],
                      ["--sizes", "60,40"], ["--sizes", "9"], ["--vertex", "100000"], ["--realisations", "34"],
                      ["--experiments", "0"], ["--significance", "1"], ["--preset", "best"], ["--field", "radius"],
                      ["--field", "H=h.npy"], ["--field", "radius=r.ply"]):
            with self.subTest(words=words):
                noise = [] if words[0] == "--noise" else ["--noise", "0.02"]
                self.assertEqual(self.dupin("mls", "scale", "t.ply", *noise, *words)[0], 2)
        self.assertEqual(self.dupin("mls", "scale", "no.ply", "--noise", "0.02")[0], 3)


class Keypoints(ErrorBars):
    def setUp(self):
        super().setUp()
        self.noise = self.synth("b.ply", "--shape", "bumpy-sphere", "--vertices", "2500", "--noise", "30", "--seed",
                                "3")["noise_sigma"]

    def found(self, name, *words, noise=None):
        return self.json_of("keypoints", name, "--noise", repr(self.noise if noise is None else noise), *words)

    def test_the_answer_has_the_fields_that_are_promised(self):
        for answer in (self.found("b.ply"), self.json_of("keypoints", "b.ply")):
            self.assertEqual(list(answer),
                             ["mean_edge_length", "tau", "noise_sigma", "advised_level", "keypoints", "warnings"])
            for point in answer["keypoints"]:
                self.assertEqual(set(point), POINT)
                for name in ("snr", "p_value"):
                    self.assertEqual(point[name] is None, answer["noise_sigma"] is None)
            self.assertEqual(answer["advised_level"] is None, answer["noise_sigma"] is None)
        certain = self.found("b.ply", noise=0.0)
        self.assertGreater(len(certain["keypoints"]), 0)
        for point in certain["keypoints"]:
            self.assertEqual([point[k] for k in ("snr", "p_value", "position_sd")], [None, 0.0, 0.0])

    def test_the_unit_of_length_scales_lengths_and_nothing_else(self):
        self.noise = self.synth("b.ply", "--shape", "bumpy-sphere", "--vertices", "5000", "--noise", "30", "--seed",
                                "3")["noise_sigma"]  # large enough for a scale that is known
        plain = self.found("b.ply")
        self.assertGreaterEqual(len(plain["keypoints"]), 12)
        self.assertTrue(any(point["radius_sd"] for point in plain["keypoints"]))
        for factor in (0.001, 10.0):
            self.scaled("b.ply", "s.ply", factor)
            scaled = self.found("s.ply", noise=factor * self.noise)
            self.assertEqual([p["vertex"] for p in plain["keypoints"]], [p["vertex"] for p in scaled["keypoints"]])
            self.assertEqual(plain["advised_level"], scaled["advised_level"])
            for a, b in zip(plain["keypoints"], scaled["keypoints"]):
                # Replicas are single precision: 6e-8 a step over some 400 products.
                self.near(b["snr"], a["snr"], 1e-4)
                self.near(b["p_value"], a["p_value"], 2e-2)  # its logarithm is a square of the snr
                for name in ("radius", "position_sd", "radius_sd"):
                    self.near(b[name], None if a[name] is None else factor * a[name], 1e-3)

    def test_every_number_of_threads_writes_the_same_bytes(self):
        answers = {self.done("keypoints", "b.ply", "--noise", "auto", "--json", "--threads", n) for n in "12"}
        self.assertEqual(len(answers), 1)

    def test_stricter_thresholds_keep_a_part_of_what_looser_ones_keep(self):
        everything = self.found("b.ply")["keypoints"]
        for option, values in (("--min-snr", (0.0, 2.0, 5.0, 10.0, 1e9)), ("--significance", (1.0, 0.5, 0.05, 1e-6))):
            kept = everything
            counts = []
            for value in values:
                now = self.found("b.ply", option, repr(value))["keypoints"]
                for point in now:  # with the same numbers, not only the same place
                    self.assertIn(point, kept)
                    if option == "--min-snr":
                        self.assertGreaterEqual(point["snr"], value)
                    else:
                        self.assertLessEqual(point["p_value"], value)
                if option == "--min-snr":  # and nothing else is left out
                    self.assertEqual(len(now), sum(point["snr"] >= value for point in everything))
                kept = now
                counts.append(len(now))
            self.assertGreater(counts[0], counts[-1], option)
            top = self.found("b.ply", option, repr(values[1]), "--top", "3")["keypoints"]
            self.assertEqual(top, self.found("b.ply", option, repr(values[1]))["keypoints"][:3])

    def test_more_noise_is_less_certain(self):
        once = {p["vertex"]: p for p in self.found("b.ply")["keypoints"]}
        twice = self.found("b.ply", noise=2 * self.noise)["keypoints"]
        for point in twice:  # first order: twice the noise, twice the deviation
            self.near(point["snr"], 0.5 * once[point["vertex"]]["snr"], 1e-3)
            if point["position_sd"] is not None:
                self.near(point["position_sd"], 2 * once[point["vertex"]]["position_sd"], 1e-3)

    def test_the_colours_of_a_picture_follow_the_range(self):
        with open(self.path("kp.json"), "wb") as out:
            out.write(self.done("keypoints", "b.ply", "--noise", "auto", "--json", "--quiet"))
        drawn = []
        for more in ([], ["--range", "0,1000"], ["--map", "diverging"]):
            self.done("render", "b.ply", "-o", "p.png", "--keypoints", "kp.json", "--color", "snr", "--no-legend",
                      "--size", "160x120", *more)
            with open(self.path("p.png"), "rb") as file:
                drawn.append(file.read())
        self.assertEqual(len(set(drawn)), 3)

    def test_wrong_options_are_wrong_usage(self):
        for words in (["--noise", "-1"], ["--noise", "nan"], ["--noise", "inf"], ["--noise", "some"],
                      ["--replicas", "7"], ["--replicas", "5000"], ["--min-snr", "-1"], ["--min-snr", "nan"],
                      ["--significance", "-0.1"], ["--significance", "1.5"], ["--significance", "nan"]):
            with self.subTest(words=words):
                self.assertEqual(self.dupin("keypoints", "b.ply", *words)[0], 2)
        with open(self.path("few.xyz"), "w", encoding="ascii") as out:
            out.writelines(f"{i} {i * i % 7} {i % 3}\n" for i in range(9))
        answer = self.json_of("mls", "noise", "few.xyz", status=5)
        self.assertEqual(answer["error"]["code"], "E_TOO_FEW_POINTS")


class Demo(ErrorBars):
    def test_the_noisy_scan_tells_what_it_shows(self):
        answer = self.json_of("demo", "page")
        scan = answer["noisy_scan"]
        # The bumpy sphere: smooth, so that its noise is that which was added.
        self.assertLess(abs(scan["sigma"] - scan["sigma_added"]), 4 * scan["sigma_standard_error"])
        self.assertLess(scan["sigma_standard_error"], 0.02 * scan["sigma"])
        self.assertLess(scan["sigma_without"], 0.01 * scan["sigma"])
        # The page's numbers are those of the command that it names.
        kept = self.json_of("keypoints", scan["surface"], "--significance", "0.05")
        self.assertEqual(len(kept["keypoints"]), scan["kept"])
        self.near(kept["noise_sigma"], scan["sigma"], 1e-9)
        self.assertEqual(kept["advised_level"], scan["advised_level"])
        self.assertEqual(len(self.json_of("keypoints", scan["surface"])["keypoints"]), scan["keypoints"])
        # What is kept is real more often than what is not.
        lost = scan["keypoints"] - scan["kept"]
        lost_real = scan["with_counterpart"] - scan["kept_with_counterpart"]
        self.assertGreater(scan["kept_with_counterpart"] * lost, lost_real * scan["kept"])
        with open(self.path("page", "index.html"), encoding="utf-8") as file:
            page = file.read()
        for name in os.listdir(self.path("page")):
            if name.endswith(".png"):
                self.assertIn(name, page)


if __name__ == "__main__":
    unittest.main()
