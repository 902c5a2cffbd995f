"""--help, --version and devices."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np


def commands(ok, *words: str):
    """The program itself and all its commands with their help, as the program lists them."""
    text = ok(*words, "--help").out
    yield words, text
    listed = text.split("\nSubcommands:\n")[1].split("\n\n")[0] if "\nSubcommands:\n" in text else ""
    for name in re.findall(r"^  (\w+)", listed, re.MULTILINE):
        yield from commands(ok, *words, name)


def test_help_of_every_command(ok) -> None:
    """It fits a terminal of 80 columns, shows examples, and describes every option beside its names or below."""
    found = dict(commands(ok))
    assert {(), ("render",), ("gap", "power"), ("doe", "inspect"), ("capture", "emva")} <= set(found)
    for words, text in found.items():
        assert "Usage: clspeckle" in text and "Examples:" in text, words
        assert [line for line in text.splitlines() if len(line) > 80] == [], words
        assert text == ok(*words, "-h").out
        lines = text.splitlines()
        options = [i for i, line in enumerate(lines) if re.match(r"  -", line)]
        assert options, words
        for i in options:
            described = re.search(r" {2,}\S+ \S", lines[i][2:]) or re.match(r" {6,26}\S", lines[i + 1])
            assert described, (words, lines[i])


def test_quiet_keeps_warnings(ok, tmp_path: Path) -> None:
    """So says the help of each command that has it, and so it is: summaries go, warnings stay."""
    found = [text for _, text in commands(ok) if "--quiet" in text]
    assert len(found) >= 10
    for text in found:
        said = re.search(r"--quiet\s+((?:[^\n]|\n {8,}(?=\S))+)", text)
        assert said and re.match(r"Print warnings(?: and errors|, errors and results) only", " ".join(said[1].split()))
    np.save(tmp_path / "dark.npy", np.zeros((24, 32), np.float32))
    render = ["render", "dark.npy", "-o", "out", "--no-preview", "--exposure-gain", 100]
    loud, quiet = ok(*render), ok(*render, "--quiet")
    assert "is 0 everywhere" in loud.err and loud.out
    assert (quiet.out, quiet.err) == ("", loud.err)


def test_help_explains_the_exit_codes(ok) -> None:
    text = ok("--help").out
    for code in ("0", "1", "2", "3", "130"):
        assert re.search(rf"^  {code}  \w", text, re.MULTILINE)


def test_version(ok) -> None:
    assert re.fullmatch(r"clspeckle \d+\.\d+\.\d+\n", ok("--version").out)


def test_examples_in_the_help_are_valid(ok, refused, tmp_path: Path) -> None:
    """Every `clspeckle render` and `statistics` example names known options and commands: what fails is only its
    files."""
    text = ok("--help").out + ok("render", "--help").out + ok("statistics", "--help").out
    joined = text.replace("\\\n", " ")
    examples = re.findall(r"^  clspeckle ((?:render|statistics) .*)$", joined, re.MULTILINE)
    assert len(examples) >= 9
    for example in examples:
        words = [word.strip("'") for word in example.split(" > ")[0].split()]
        if "--dump-config" in words:
            continue
        message = refused(*words)
        assert "no option" not in message and "no command" not in message, example
        assert re.search(r"No such file|no file matches", message), message


def test_devices(ok) -> None:
    listed = ok("devices", "--json").json()
    usable = [device for device in listed["devices"] if device["usable"]]
    assert usable, "the tests need a device"
    first = min(usable, key=lambda device: device["rank"])
    assert first["name"] in listed["explanation"]
    text = ok("devices").out
    assert first["selector"] in text and first["name"] in text
    assert listed["explanation"].strip() in text


def test_devices_explains_a_selector(ok, cli) -> None:
    first = ok("devices", "--json").json()["devices"][0]
    assert first["name"] in ok("devices", "--device", first["selector"]).out
    assert "no such device" in cli("devices", "--device", "no such device").out


def test_json_owns_standard_output(program: Path, ideal: Path, tmp_path: Path) -> None:
    """Whatever else is printed goes to standard error."""
    import json

    command = [program, "render", ideal.name, "-o", "out", "--frames", "2", "--json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    json.loads(done.stdout)
    assert done.stdout.startswith("{") and done.stdout.endswith("}\n")
