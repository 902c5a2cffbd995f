#!/usr/bin/env python3
"""Whether two builds of clSpeckle make the same bytes: frames with every effect and engine, diffractive elements, depth
of dots, reports and comparisons.

    scripts/same_bytes.py BEFORE AFTER [--sets FOLDER ...] [--only TEXT] [--json]

BEFORE and AFTER are build folders (with bin/clspeckle and lib/libclspeckle.so). Each case is a table row: the same
command line is run by both programs, and every file that they write, with what they print, is compared. Dots and their
effects, which `render` has not, go through the Python binding with either library. What depends on the run (times,
versions) is left out of reports. A command that fails compares nothing, and counts as a difference. Exit code 1 where
something differs. A change that shall leave frames and reports as they are is run through this.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SCENE = ROOT / "examples" / "office" / "gbuffers"
# Of a report: what the clock and the build say.
OF_THE_RUN = {"seconds", "date", "version", "clspeckle_version", "library_version", "memory_bytes", "peak_memory_bytes"}
# Four frames of ideal dots, drawn anew, at rest and drawn anew; arguments: effect ("" for none), output file.
DOTS = """
import sys
import numpy as np
import clspeckle
y, x = np.mgrid[6:64:12, 6:96:12]
with clspeckle.Context() as context:
    dots = clspeckle.Dots((64, 96), np.stack([x.ravel(), y.ravel()], axis=1), sigma_px=2.0, scale=1.5, context=context)
    camera = clspeckle.Pipeline.from_parameters((64, 96), dots=dots, context=context, seed=11, exposure_gain_dn=400.0)
    if sys.argv[1]:
        camera.set_effect(sys.argv[1])
    np.save(sys.argv[2], [camera.render(frame_index=i, refresh=r) for i, r in enumerate(("all", None, None, "all"))])
"""
# Of the catalogue's effects, those of ideal dots alone.
OF_DOTS = {"wavelength_shift", "beam_skew", "beam_flat_top", "zero_order", "ghost_dots", "scatter_background"}

Case = tuple[str, list[str], dict[str, str]]  # name, arguments, environment


def write_inputs(folder: Path, program: Path) -> None:
    y, x = np.mgrid[0:72, 0:96]
    image = 0.1 + np.exp(-(((x % 11 - 5) ** 2 + (y % 11 - 6) ** 2) / 4.0))
    np.save(folder / "ideal.npy", image.astype(np.float32))
    (folder / "dots.py").write_text(DOTS)
    for name in ("sequence.json", "pattern.png"):
        (folder / name).write_bytes((SCENE / name).read_bytes())
    with tarfile.open(SCENE / "frames.tar.xz") as archive:
        archive.extractall(folder, filter="data")
    for words in (
        ["doe", "layout", "-o", "dots", "--dots", "601", "--field-of-view", "28,19"],
        ["doe", "design", "dots.json", "-o", "element", "--iterations", "20"],
        ["doe", "pattern", "element.npy", "-o", "lattice.npy", "--half-extent", "0.26", "--beam-sigma-um", "120"],
        ["render", "sequence.json", "-o", "scene", "--pattern", "lattice.npy", "--exposure-gain", "auto", "--quiet"],
    ):
        subprocess.run([program, *words], cwd=folder, check=True, capture_output=True)


def cases(program: Path, sets: list[Path]) -> Iterator[Case]:
    """Each in the folder of the inputs; "{out}" is the case's own folder."""
    render = ["render", "ideal.npy", "-o", "{out}", "--frames", "3", "--seed", "7", "--quiet"]
    still = ["render", "ideal.npy", "ideal.npy", "ideal.npy", "-o", "{out}", "--seed", "7", "--quiet"]
    for name, options in {
        "plain": [],
        "unpolarized": ["--degree-of-polarization", "0"],
        "intensity": ["--no-sensor", "--format", "float-npy"],
        "oversampled": ["--oversampling", "2", "--guard-px", "8"],
        "unit phasors": ["--field", "unit_phasor"],
        "profile": ["--sensor-profile", "OS04A10"],
    }.items():
        yield f"frame, {name}", render + options, {}
    for engine in ("clfft", "cpu", "gpu"):
        for p in ("1", "0"):
            yield f"engine {engine}, p = {p}", [*render, "--degree-of-polarization", p], {"CLSPECKLE_FFT": engine}
    yield "scene", ["render", "sequence.json", "-o", "{out}", "--exposure-gain", "auto", "--quiet"], {}
    moving = ["render", "sequence.json", "-o", "{out}", "--motion", "correlate", "--quiet"]
    yield "scene in motion", moving, {}
    listed = json.loads(
        subprocess.run([program, "effects", "--json"], check=True, capture_output=True, text=True).stdout
    )
    yield "effects", ["effects", "--json"], {}
    yield "dots", ["dots.py", "", "{out}/frames.npy"], {}
    for effect in listed["effects"] if isinstance(listed, dict) else listed:
        name = effect["id"]
        if name not in OF_DOTS:
            yield f"effect {name}", [*render, "--effect", name], {}
            yield f"effect {name}, at rest", [*still, "--effect", name], {}
        yield f"effect {name}, dots", ["dots.py", name, "{out}/frames.npy"], {}
    small = ["--iterations", "10"]
    for name, options in {"": [], " of 2 levels, searched": ["--levels", "2", "--search", "2", "--mirror"]}.items():
        yield f"doe design{name}", ["doe", "design", "dots.json", "-o", "{out}/element", *small, *options], {}
    yield "doe layout", ["doe", "layout", "-o", "{out}/dots", "--dots", "601"], {}
    defects = ["--levels", "8", "--depth-error", "0.03", "--etch-noise-nm", "15"]
    for name, options in {"": [], " with defects": defects}.items():
        pattern = ["doe", "pattern", "element.npy", "-o", "{out}/pattern.npy", "--beam-sigma-um", "300,250", *options]
        yield f"doe pattern{name}", pattern, {}
    found = ["--dots", "dots.json", "--geometry", "sequence.json", "--csv", "{out}/dots.csv", "--json"]
    yield "depth", ["depth", "scene/frame_000000.png", *found], {}
    for first, second in zip(sets, sets[1:]):
        compared = ["gap", "compare", str(first), str(second), "--json", "{out}/report.json", "--quiet"]
        yield f"comparison of {first.name} with {second.name}", compared, {}
    for capture in sets[:1]:
        yield f"page of {capture.name}", ["diagnose", str(capture), "--html", "{out}/page.html", "--quiet"], {}
    for capture in sets:
        yield f"check of {capture.name}", ["capture", "check", str(capture)], {}
        yield f"report of {capture.name}", ["diagnose", str(capture), "--json", "{out}/report.json", "--quiet"], {}


def without_run(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: without_run(v) for k, v in value.items() if k not in OF_THE_RUN}
    return [without_run(v) for v in value] if isinstance(value, list) else value


def without_clock(text: bytes) -> bytes:
    """Without times, and what PoCL's compiler says where a kernel is built for the first time."""
    passing = rb"\d+ warnings? generated\.|time +[\d.]+ m?s"
    return b"\n".join(line for line in text.split(b"\n") if not re.fullmatch(passing, line))


def outcome(program: Path, case: Case, inputs: Path) -> dict[str, bytes]:
    """What the command leaves: its exit code, what it prints, and its files."""
    with tempfile.TemporaryDirectory() as out:
        words = [word.replace("{out}", out) for word in case[1]]
        environment = {**os.environ, "CLSPECKLE_TUNING": "off", **case[2]}
        first: list[Path | str] = [program]
        if words[0].endswith(".py"):
            first = [sys.executable]
            environment["CLSPECKLE_LIBRARY"] = str(program.parents[1] / "lib" / "libclspeckle.so")
            environment["PYTHONPATH"] = str(ROOT / "bindings" / "python" / "src")
        done = subprocess.run([*first, *words], cwd=inputs, env=environment, capture_output=True, check=False)
        said = {
            "exit code": str(done.returncode).encode(),
            "output": without_clock(done.stdout),
            "messages": without_clock(done.stderr),
        }
        result = {name: text.replace(out.encode(), b"{out}") for name, text in said.items()}
        for path in sorted(Path(out).rglob("*")):
            if path.is_file():
                content = path.read_bytes()
                if path.suffix == ".json":
                    content = json.dumps(without_run(json.loads(content))).encode()
                result[str(path.relative_to(out))] = content
    return result


def difference(before: dict[str, bytes], after: dict[str, bytes]) -> str:
    if before["exit code"] != b"0" or after["exit code"] != b"0":
        said = before if before["exit code"] != b"0" else after
        last = said["messages"].decode(errors="replace").strip().splitlines()[-1:]
        return f"fails {'before' if said is before else 'after'}, and compares nothing: {''.join(last)}"
    for name in [*before, *(name for name in after if name not in before)]:
        a, b = before.get(name), after.get(name)
        if a is None or b is None:
            return f"{name}: only {'after' if a is None else 'before'}"
        if a != b:
            at = next((i for i, (x, y) in enumerate(zip(a, b)) if x != y), min(len(a), len(b)))
            return f"{name}: from byte {at} of {len(a)} and {len(b)} on"
    return ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, help="build folder of the one program")
    parser.add_argument("after", type=Path, help="build folder of the other")
    parser.add_argument(
        "--sets", type=Path, nargs="*", default=[], help="folders of capture sets to diagnose with both"
    )
    parser.add_argument("--only", default="", help="only cases whose name contains this")
    parser.add_argument("--json", action="store_true", help="print the outcome as JSON")
    given = parser.parse_args()
    programs = [(folder / "bin" / "clspeckle").resolve() for folder in (given.before, given.after)]
    missing = [str(program) for program in programs if not program.is_file()]
    if missing:
        parser.error(f"no program at {', '.join(missing)}; name build folders in which clspeckle is built")
    sets = [folder.resolve() for folder in given.sets]
    different: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        inputs = Path(folder)
        write_inputs(inputs, programs[0])
        chosen = [case for case in cases(programs[0], sets) if given.only in case[0]]
        if not chosen:
            parser.error(f"no case is named like {given.only!r}")
        for number, case in enumerate(chosen, 1):
            where = difference(*(outcome(program, case, inputs) for program in programs))
            if where:
                different[case[0]] = where
            print(f"{number:4}/{len(chosen)}  {case[0]}: {where or 'same'}", file=sys.stderr, flush=True)
    if given.json:
        print(json.dumps({"cases": len(chosen), "different": different}, indent=2))
    else:
        print(f"{len(chosen) - len(different)} of {len(chosen)} cases are the same")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
