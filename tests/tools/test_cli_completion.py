"""What shells complete behind the program's name, and the manual page."""

from __future__ import annotations

import os
import pty
import re
import select
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from test_cli_help import commands


def candidates(ok, *words: str) -> list[str]:
    """What the program offers for the last of some words."""
    return [line.split("\t")[0] for line in ok("complete", "--", *words).out.splitlines()]


def test_commands(ok) -> None:
    assert {"render", "diagnose", "doe", "completion"} <= set(candidates(ok, ""))
    assert candidates(ok, "ren") == ["render"]
    assert candidates(ok, "capture", "e") == ["emva"]
    assert candidates(ok, "no-such-command") == []
    assert candidates(ok) == candidates(ok, "")


def test_options_are_those_of_the_help(ok) -> None:
    for words, text in commands(ok):
        offered = {word for word in candidates(ok, *words, "-") if word.startswith("--")}
        options = "\n".join(re.findall(r"^  (-.*?)(?:  |$)", text, re.MULTILINE))
        assert offered == set(re.findall(r"--[\w-]+", options)), words


def test_values(ok) -> None:
    assert candidates(ok, "render", "--pattern-filter", "") == ["bilinear", "area"]
    assert candidates(ok, "render", "--pattern-filter", "a") == ["area"]
    assert candidates(ok, "render", "--pattern-filter=a") == ["area"]
    assert candidates(ok, "render", "--pattern-filter", "=", "a") == ["area"]  # as bash cuts it
    assert candidates(ok, "render", "--pattern-filter", "=") == ["bilinear", "area"]
    assert candidates(ok, "doe", "inspect", "--beam", "flat") == ["flat_circle", "flat_square"]
    assert candidates(ok, "render", "--effect", "defo") == ["defocus"]
    assert candidates(ok, "render", "--seed", "") == []
    assert candidates(ok, "render", "--config", "ca") == [":files"]
    assert candidates(ok, "render", "-o", "") == [":folders"]
    assert candidates(ok, "render", "--seed", "3", "") == [":files"]
    assert candidates(ok, "completion", "") == ["bash", "fish", "zsh"]
    assert candidates(ok, "--help", "ren") == ["render"]


def test_no_other_shell(refused) -> None:
    assert "bash" in refused("completion", "tcsh")


def typed(shell: list[str], setup: str, keys: str, wanted: str, folder: Path) -> str:
    """What an interactive shell shows after these keys."""
    environment = {
        **os.environ,
        "TERM": "dumb",
        "HOME": str(folder),
        "ZDOTDIR": str(folder),
        "PS1": "$ ",
        "HISTFILE": "",
    }
    process, terminal = pty.fork()
    if process == 0:
        os.chdir(folder)
        os.execvpe(shell[0], shell, environment)
    shown = ""

    def read(until: str, seconds: float) -> None:
        nonlocal shown
        end = time.monotonic() + seconds
        while until not in shown and time.monotonic() < end:
            if select.select([terminal], [], [], 0.1)[0]:
                try:
                    shown += os.read(terminal, 4096).decode(errors="replace")
                except OSError:
                    return

    os.write(terminal, f"{setup}; echo rea''dy\n".encode())
    read("ready", 60)
    shown = ""
    for key in keys.split("|"):  # a shell that completes drops what is typed meanwhile
        os.write(terminal, key.encode())
        read(wanted, 3)
    read(wanted, 30)
    os.close(terminal)
    os.waitpid(process, 0)
    return shown


SHELLS = {
    "bash": (["bash", "--norc", "--noprofile", "-i"], "source <(clspeckle completion bash)"),
    "zsh": (["zsh", "-f", "-i"], "autoload -Uz compinit; compinit -u; source <(clspeckle completion zsh)"),
    "fish": (["fish", "--no-config", "-i"], "clspeckle completion fish | source"),
}


@pytest.mark.parametrize("shell", [name for name in SHELLS if name == "bash" or shutil.which(name)])
def test_a_shell_completes(shell: str, program: Path, tmp_path: Path) -> None:
    (tmp_path / "camera-of-mine.json").write_text("{}")
    command, setup = SHELLS[shell]
    path = f"export PATH={program.parent}:$PATH; {setup}"
    for keys, wanted in (
        ("clspeckle ren\t", "clspeckle render "),
        ("clspeckle render --pattern-fil\t", "clspeckle render --pattern-filter "),
        ("clspeckle render --pattern-filter ar\t", "clspeckle render --pattern-filter area "),
        ("clspeckle doe ins\t|--zo\t", "clspeckle doe inspect --zoom "),
        ("clspeckle render --config cam\t", "clspeckle render --config camera-of-mine.json "),
    ):
        assert wanted in plain(typed(command, path, keys, wanted, tmp_path)), keys


def plain(text: str) -> str:
    """Without what moves the cursor, and what was taken back."""
    return re.sub(r".\x08", "", re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]|\x1b[=>]|[\r\x07]", "", text))


def test_the_manual_page(ok, tmp_path: Path) -> None:
    """roff without a warning; each command and each option has its place."""
    page = tmp_path / "clspeckle.1"
    page.write_text(ok("man").out)
    formatted = subprocess.run(
        ["groff", "-man", "-ww", "-Tutf8", "-P-cbou", "-rLL=200n", page], capture_output=True, text=True, check=False
    )
    assert formatted.returncode == 0
    assert formatted.stderr == ""
    text = formatted.stdout.replace("\u2010", "-").replace("\u2212", "-")
    assert re.search(r"^NAME\n +clspeckle - simulate", text, re.MULTILINE)
    for words, help_text in commands(ok):
        if words:
            assert re.search(rf"^ +clspeckle {' '.join(words)}$", text, re.MULTILINE), words
        for option in re.findall(r"^  (-.*?)(?:  |$)", help_text, re.MULTILINE):
            assert re.search(rf"^ +{re.escape(option)}( |$)", text, re.MULTILINE), (words, option)
