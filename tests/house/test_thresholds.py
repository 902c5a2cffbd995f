"""The numbers that steer the inference stand in one struct, each with its unit, what it gates, and evidence that is
there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HEADER = ROOT / "diagnosis/inference/thresholds.hpp"
FIELD = re.compile(r"((?:^ +// .*\n)+)^ +(?:double|int|std::\w+) (\w+)(?:\[\d+\])? = .*;$", re.MULTILINE)
ANY_FIELD = re.compile(r"^ +(?:double|int|std::\w+) (\w+)(?:\[\d+\])? = .*;$", re.MULTILINE)
NUMBER = re.compile(r"^ *(?:static )?constexpr (?:double|float|int|unsigned|std::\w+|Eigen::Index) ", re.MULTILINE)
NAME = re.compile(r"\b(k[A-Z]\w*)(?:\[\])? =")

# Numbers that decide nothing: mathematics, what the catalogue's ranges are meant for, seeds, memory, progress, a
# printed floor.
OTHERS = {
    "kDeviations95", "kRoundingDn", "kQuantizationVariance", "kSqrtTwoPi", "kMostTerms",
    "kCatalogueBits", "kCatalogueReadNoiseDn", "kScreeningStrengths",
    "kCalibrationSeed", "kScatterSeed", "kPoolSeed", "kFilter", "kMeasuring",
    "kMostWorkers", "kWorkersPerThread", "kCacheBytes", "kMemoBytes", "kFirstPiece",
    "kBegin", "kSecond", "kEnd", "kFirstSearch", "kSecondSearch", "kOfReplicates", "kOfRungsBelow",
    "kLeastPValue",
}  # fmt: skip


def fields() -> dict[str, list[str]]:
    text = HEADER.read_text()
    result = {}
    for comment, name in FIELD.findall(text):
        words = " ".join(line.strip().removeprefix("//").strip() for line in comment.splitlines())
        result[f"{name} @{len(result)}"] = [part.strip() for part in words.split(" | ")]
    assert len(result) == len(ANY_FIELD.findall(text)) > 90, "a number without a comment above it"
    return result


@pytest.mark.parametrize(("name", "parts"), fields().items(), ids=lambda value: value if isinstance(value, str) else "")
def test_each_number_says_unit_gate_and_evidence(name: str, parts: list[str]) -> None:
    assert len(parts) == 3 and all(parts), f"{name}: unit | what it gates | evidence"
    if parts[2] == "work" or parts[2].startswith("law: "):
        return
    file, _, words = parts[2].partition(" ")
    assert (ROOT / file).is_file(), f"{name}: {file} is not there"
    assert words in (ROOT / file).read_text(), f"{name}: {file} does not have the words {words!r}"


def test_no_other_number_decides() -> None:
    files = sorted((ROOT / "diagnosis/inference").glob("*.[ch]pp"))
    files += [ROOT / "diagnosis/measure/verdict.cpp", ROOT / "diagnosis/run/diagnose.cpp"]
    found = {
        f"{file.name}: {name}"
        for file in files
        if file != HEADER
        for line in file.read_text().splitlines()
        if NUMBER.match(line)
        for name in NAME.findall(line)
        if name not in OTHERS
    }
    assert not found, f"numbers belong into {HEADER.relative_to(ROOT)}: {sorted(found)}"
