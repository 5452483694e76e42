#!/usr/bin/env python3
"""`dupin completion` in a real bash; for zsh and fish, that the script names every verb and option.

usage: completion_test.py DUPIN
"""
import json
import os
import re
import subprocess
import sys
import unittest

DUPIN = os.path.abspath(sys.argv.pop(1))


def dupin(*arguments):
    process = subprocess.run([DUPIN, *arguments], capture_output=True, text=True, timeout=60)
    assert process.returncode == 0, process.stderr
    return process.stdout


def complete(*words):
    """What bash offers for the last of `words`."""
    quoted = " ".join("'" + word + "'" for word in words)
    script = f"""
{dupin("completion", "bash")}
complete -p dupin >&2
COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}
_dupin
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    process = subprocess.run(["bash", "--norc", "-u", "-c", script], capture_output=True, text=True,
                             timeout=60)
    assert process.returncode == 0, process.stderr
    assert "-o default" in process.stderr  # an empty answer completes file names
    return [word for word in process.stdout.split("\n") if word]


def verbs():
    """Every verb with the options that its --help names."""
    text = dupin("--help")
    found = {}
    for name in re.findall(r"^  ([a-z][a-z-]*) {2,}", text[text.index("Subcommands:"):], re.M):
        path = [name]
        page = dupin(*path, "--help")
        if "Subcommands:" in page:
            path.append(re.findall(r"^  ([a-z][a-z-]*) {2,}", page[page.index("Subcommands:"):], re.M)[0])
            page = dupin(*path, "--help")
        found[" ".join(path)] = set(re.findall(r"^  (?:-\w,)?(--[a-z0-9-]+)", page, re.M))
    return found


class Completion(unittest.TestCase):
    def test_a_verb_is_completed(self):
        known = [name.split()[0] for name in verbs()]
        self.assertGreater(len(known), 3)
        self.assertEqual(sorted(set(known)), sorted(w for w in complete("dupin", "")))
        for name in known:
            expected = [other for other in known if other.startswith(name[:3])]
            self.assertEqual(sorted(complete("dupin", name[:3])), sorted(expected))

    def test_every_option_of_every_verb_is_completed(self):
        for name, options in verbs().items():
            self.assertIn("--json", options, name)
            offered = complete("dupin", *name.split(), "--")
            self.assertEqual(options - set(offered), set(), name)

    def test_keypoints_and_its_rule(self):
        self.assertEqual(complete("dupin", "key"), ["keypoints"])
        self.assertEqual(complete("dupin", "keypoints", "--ru"), ["--rule"])
        self.assertEqual(complete("dupin", "keypoints", "--rule", "pers"), ["persistent"])
        self.assertEqual(complete("dupin", "keypoints", "--rule", "=", "pers"), ["persistent"])

    def test_choices_follow_their_option_and_files_the_others(self):
        self.assertEqual(complete("dupin", "synth", "surface", "--shape", "tor"), ["torus"])
        self.assertEqual(complete("dupin", "synth", "surface", "--shape", "=", "tor"), ["torus"])
        self.assertEqual(complete("dupin", "synth", "su"), ["surface"])
        self.assertEqual(complete("dupin", "completion", ""), ["bash", "zsh", "fish"])
        self.assertEqual(complete("dupin", "check", "sca"), [])
        self.assertEqual(complete("dupin", "synth", "surface", "-o", ""), [])

    def test_a_verb_name_as_a_file_changes_nothing(self):
        self.assertIn("--drop-nonfinite", complete("dupin", "check", "synth", "--drop"))

    def test_zsh_and_fish_name_every_verb_and_option(self):
        for name, options in verbs().items():
            for option in options:
                self.assertIn(f"'{option}:", dupin("completion", "zsh"), name)
                self.assertIn(f" -l {option[2:]} ", dupin("completion", "fish"), name)
            self.assertIn(f"'dupin {name}'", dupin("completion", "zsh"))
            self.assertIn(f" -a {name.split()[-1]} ", dupin("completion", "fish"))

    def test_json_holds_the_script(self):
        document = json.loads(dupin("completion", "bash", "--json"))
        self.assertEqual(document["shell"], "bash")
        self.assertEqual(document["script"] + "\n", dupin("completion", "bash"))


if __name__ == "__main__":
    unittest.main()
