"""Product code does not know effects by their ids: what it needs of one stands in the effect's record, and the code
asks that."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CATALOGUE = ROOT / "core/effects/effects.cpp"
GENERATED = ROOT / "bindings/python/src/clspeckle/_generated.py"
IDS = set(re.findall(r'Effect\{"(\w+)"', CATALOGUE.read_text()))
FOLDERS = ("bindings/cpp", "bindings/python", "capi", "core", "diagnosis", "io", "kernels", "tools")

# Words that are something else, too. The files that say them so, and what they are there.
OTHERS = {
    "airflow": {"core/stages/airflow.cpp": "commands"},
    "dark_current": {"diagnosis/measure/emva1288.cpp": "a quantity", "diagnosis/report/emva_report.cpp": "a section",
                     "tools/diagnosis_summary.cpp": "a quantity"},
    "defocus": {"tools/effects.cpp": "an example in a text"},
    "dsnu": {"diagnosis/measure/emva1288.cpp": "a quantity", "tools/diagnosis_summary.cpp": "a quantity"},
    "gamma": {"bindings/python/src/clspeckle/pipeline.py": "a member",
              "core/stages/sensor.cpp": "a parameter", "io/transfer.cpp": "part of a color space's name"},
    "glare": {"core/stages/lens.cpp": "commands"},
    "power_flicker": {"core/pipeline/pipeline.cpp": "a parameter"},
    "prnu": {"core/stages/sensor.cpp": "a parameter",
             "diagnosis/measure/emva1288.cpp": "a quantity", "tools/diagnosis_summary.cpp": "a quantity"},
    "shot_noise": {"bindings/python/src/clspeckle/sensor.py": "a member"},
    "zero_order": {"tools/doe_design.cpp": "a number of a report",
                   "tools/doe_pattern.cpp": "a number of a report"},
} | {
    name: {"diagnosis/measure/gap_stages.cpp": "a statistic",
           "diagnosis/report/explanations.cpp": "a statistic and a quantity",
           "diagnosis/statistics/quantities.cpp": "a quantity",
           "diagnosis/statistics/temporal_noise.cpp": "a statistic"}
    for name in ("column_noise", "row_noise")
}  # fmt: skip


def words_of_cpp(text: str) -> Iterator[str]:
    text = re.sub(r'R"(\w*)\(.*?\)\1"', '""', text, flags=re.DOTALL)  # examples in texts
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    for line in text.splitlines():
        yield from re.findall(r'"(\w+)"', re.sub(r"^\s*//.*|\s//\s.*", "", line))


def words_of_python(text: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def test_the_catalogue_is_read() -> None:
    assert len(IDS) > 40
    assert {"defocus", "image_lag"} <= IDS


def test_no_code_knows_an_effect_by_its_id() -> None:
    found, used = [], set()
    for path in sorted(p for folder in FOLDERS for p in (ROOT / folder).rglob("*")):
        if path.suffix not in (".cpp", ".hpp", ".h", ".cl", ".py") or path in (CATALOGUE, GENERATED):
            continue
        name = path.relative_to(ROOT).as_posix()
        words = words_of_python if path.suffix == ".py" else words_of_cpp
        for word in sorted(IDS.intersection(words(path.read_text()))):
            if name in OTHERS.get(word, {}):
                used.add((word, name))
            else:
                found.append(f"{name}: {word}")
    assert not found, f"ask the record (core/effects/effects.hpp) instead: {found}"
    unused = {(word, name) for word, files in OTHERS.items() for name in files} - used
    assert not unused, f"no longer there: {sorted(unused)}"


def test_each_kind_is_seen() -> None:
    assert list(words_of_cpp('if (id == "defocus") // "glare"\n/* "gamma" */ R"(--effect "prnu")"')) == ["defocus"]
    assert "defocus" in words_of_python('if "defocus" in effects: pass')
