"""The binary interface: the same as recorded (abidiff), every symbol declared and called by a test, nothing else
exported."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from stub import HEADERS, build, declared

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))
LIBRARY = Path(os.environ.get("CLSPECKLE_LIBRARY", BUILD / "lib" / "libclspeckle.so"))


def run(*command: object) -> str:
    done = subprocess.run([str(word) for word in command], check=False, capture_output=True, text=True)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def symbols(library: Path) -> set[str]:
    """Exported names with their versions: name@@version."""
    lines = run("nm", "-D", "--defined-only", library).splitlines()
    assert lines
    return {line.split()[-1] for line in lines if line.split()[-2] != "A"}  # A: the version's own name


def exported(library: Path) -> set[str]:
    return {symbol.split("@")[0] for symbol in symbols(library)}


def test_exports_are_what_the_headers_declare() -> None:
    assert exported(LIBRARY) == set(declared())
    assert all(name.startswith("clsp") for name in exported(LIBRARY))


def test_every_function_is_called_by_a_test() -> None:
    """By its name in a GoogleTest, or by the fixture of a stage (tests/stage_support.hpp); a wrapper's use does not
    count."""
    text = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.cpp"))
    text = re.sub(r"//[^\n]*", "", text)
    called = set(re.findall(r"\b(clsp[A-Z]\w*)\b", re.sub(r'"[^"\n]*"', "", text)))
    stages = re.findall(r"\bStageTest<Clsp(\w+)>", text)
    called |= {f"clsp{stage}{word}" for stage in stages for word in ("DescInit", "Create", "Retain", "Release")}
    missing = exported(LIBRARY) - called
    assert not missing, f"no GoogleTest calls {sorted(missing)}"
    unknown = called - exported(LIBRARY)
    assert not unknown, f"the tests call what does not exist: {sorted(unknown)}"


def test_every_function_has_a_wrapper_in_the_cpp_binding() -> None:
    headers = ROOT / "bindings" / "cpp" / "include" / "clspeckle"
    binding = "".join(path.read_text() for path in headers.iterdir())
    used = set(re.findall(r"\bclsp[A-Z]\w*", binding))
    assert not set(declared()) - used


@pytest.fixture(scope="session")
def recorded() -> Path:
    path = HERE / "clspeckle.abi"
    assert path.is_file(), "make it with tests/abi/record.sh"
    text = path.read_text()
    assert not re.search(r"='/(?!>)", text), "the record holds a path of the machine that made it"
    return path


def abidiff(old: Path, new: Path) -> subprocess.CompletedProcess[str]:
    command = ["abidiff", "--suppressions", HERE / "suppressions.ini", "--no-show-locs", old, new]
    return subprocess.run([str(word) for word in command], check=False, capture_output=True, text=True)


FROZEN = {"ClspImage", "ClspDepthDot", "ClspDepthPatternDot", "ClspFieldGrid", "ClspStageTiming"}


def layouts(description: Path) -> dict[str, list[tuple[int, str, str]]]:
    """The members of each public struct of an abidw file: offset in bits, name, type."""
    root = ElementTree.parse(description).getroot()
    types = {element.get("id"): element for element in root.iter() if element.get("id")}

    def spell(type_id: str | None) -> str:
        element = types.get(type_id)
        if element is None:
            return "void"
        if element.tag == "pointer-type-def":
            return spell(element.get("type-id")) + "*"
        if element.tag == "qualified-type-def":
            return "const " + spell(element.get("type-id"))
        if element.tag == "array-type-def":
            lengths = [part.get("length") for part in element.iter("subrange")]
            return spell(element.get("type-id")) + "".join(f"[{length}]" for length in lengths)
        if element.tag == "typedef-decl" and not str(element.get("name")).startswith(("Clsp", "cl_")):
            return spell(element.get("type-id"))  # uint32_t is what it is on this platform
        return f"{element.get('name')}"

    found: dict[str, list[tuple[int, str, str]]] = {}
    for alias in root.iter("typedef-decl"):
        struct = types.get(alias.get("type-id"))
        name = str(alias.get("name"))
        if name.startswith("Clsp") and struct is not None and struct.tag == "class-decl":
            found[name] = [
                (int(member.get("layout-offset-in-bits", "-1")), str(part.get("name")), spell(part.get("type-id")))
                for member in struct.findall("data-member")
                for part in member.findall("var-decl")
            ]
    return found


def layout_changes(old: Path, new: Path) -> list[str]:
    """What is wrong with the structs of `new`. abidiff 2.2 lets a member change its type unseen where the suppression
    of appended members applies, so the rule is checked here once more: the old members come first, as they were."""
    changes = []
    after = layouts(new)
    for name, members in layouts(old).items():
        now = after.get(name, [])
        if now[: len(members)] != members or (name in FROZEN and now != members):
            changes.append(f"{name}: {members} became {now}")
    return changes


def describe(library: Path, description: Path) -> Path:
    run(HERE / "record.sh", library, description)
    return description


def test_headers_have_the_recorded_abi(recorded: Path, stub: Callable[..., Path], tmp_path: Path) -> None:
    result = abidiff(recorded, stub())
    changes = layout_changes(recorded, describe(stub(), tmp_path / "new.abi"))
    assert layouts(recorded).keys() >= {"ClspImage", "ClspFrame", "ClspSensorDesc"}
    assert result.returncode == 0 and not changes, (
        f"{result.stdout}{result.stderr}{changes}\nIf an old binary still works with this library, renew the record "
        "with tests/abi/record.sh; else put it back, or count CLSP_ABI_VERSION up."
    )


def test_library_has_the_symbols_of_the_headers(stub: Callable[..., Path]) -> None:
    assert symbols(LIBRARY) == symbols(stub())


# The check itself is checked.


@pytest.fixture(scope="session")
def stub(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    def make(change: Callable[[Path], None] | None = None) -> Path:
        """A library, after change(folder of the headers)."""
        folder = tmp_path_factory.mktemp("stub")
        headers = folder / "include" / "clspeckle"
        shutil.copytree(HEADERS, headers)
        if change:
            change(headers)
        library = folder / "libstub.so"
        build(library, headers)
        return library

    return make


def replace(file: str, old: str, new: str) -> Callable[[Path], None]:
    def change(headers: Path) -> None:
        text = (headers / file).read_text()
        assert text.count(old) == 1, f"{file} has {text.count(old)} times {old!r}"
        (headers / file).write_text(text.replace(old, new))

    return change


COMPATIBLE = {
    "nothing": None,
    "a member appended to a struct": replace(
        "sensor.h", "} ClspSensorDesc;", "    double appended_by_this_test;\n} ClspSensorDesc;"
    ),
    "a member appended to a struct inside of another": replace(
        "pattern.h", "} ClspGeometry;", "    double skew_px;\n} ClspGeometry;"
    ),
    "a new function": replace(
        "sensor.h",
        "CLSP_API ClspStatus clspSensorRelease(",
        "CLSP_API ClspStatus clspSensorSetBlackLevel(ClspSensor sensor, double black_level_dn);\n"
        "CLSP_API ClspStatus clspSensorRelease(",
    ),
}
INCOMPATIBLE_CHANGES = {
    "a member inserted in the middle": replace(
        "sensor.h", "    double exposure_gain_dn;", "    double conversion_gain;\n    double exposure_gain_dn;"
    ),
    "a member inserted at the front": replace(
        "aperture.h",
        "    uint32_t width;                  /**< Image width",
        "    uint32_t flags;\n    uint32_t width; /**< Image width",
    ),
    "a member of another size": replace("sensor.h", "    uint64_t seed;", "    uint64_t seed[2];"),
    "a member of another type and the same size": replace(
        "sensor.h", "    double black_level_dn;", "    int64_t black_level_dn;"
    ),
    "two members exchanged": replace(
        "philox.h",
        "    uint64_t seed;          /**< Default 0. */\n    uint64_t frame_index;",
        "    uint64_t frame_index;\n    uint64_t seed;",
    ),
    "a smaller member, padded": replace("pipeline.h", "    uint64_t frame_index;", "    uint32_t frame_index;"),
    "a member appended to a frozen struct": replace(
        "types.h", "} ClspImage;", "    uint64_t slice_bytes;\n} ClspImage;"
    ),
    "a parameter of another type": replace(
        "sensor.h",
        "clspSensorSetExposureGain(ClspSensor sensor, double",
        "clspSensorSetExposureGain(ClspSensor sensor, float",
    ),
    "a function removed": replace(
        "phase.h", "CLSP_API ClspStatus clspPhaseGetStateSize(ClspPhase phase, uint64_t *size_bytes);", ""
    ),
}


@pytest.mark.parametrize("what", COMPATIBLE)
def test_check_accepts(what: str, stub: Callable[..., Path], tmp_path: Path) -> None:
    old, new = stub(), stub(COMPATIBLE[what])
    result = abidiff(old, new)
    assert result.returncode == 0, result.stdout
    assert not layout_changes(describe(old, tmp_path / "old.abi"), describe(new, tmp_path / "new.abi"))


@pytest.mark.parametrize("what", INCOMPATIBLE_CHANGES)
def test_check_refuses(what: str, stub: Callable[..., Path], tmp_path: Path) -> None:
    old, new = stub(), stub(INCOMPATIBLE_CHANGES[what])
    changes = layout_changes(describe(old, tmp_path / "old.abi"), describe(new, tmp_path / "new.abi"))
    by_abidiff = abidiff(old, new).returncode
    assert by_abidiff >= 0, "abidiff crashed"
    assert by_abidiff or changes, f"{what} passes"
    if "inserted" in what:
        assert by_abidiff & 4, f"{what}: abidiff passes it"


def test_record_is_of_these_headers(recorded: Path, stub: Callable[..., Path], tmp_path: Path) -> None:
    """Changes in the middle are found against the record as well, not only between two libraries."""
    changed = stub(INCOMPATIBLE_CHANGES["a member inserted in the middle"])
    assert abidiff(recorded, changed).returncode & 4
    assert layout_changes(recorded, describe(changed, tmp_path / "changed.abi"))
    same = stub()
    assert not layout_changes(recorded, describe(same, tmp_path / "same.abi"))
