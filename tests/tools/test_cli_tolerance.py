"""clspeckle diagnose --tolerance: what is accepted of a simulator whose error is known, and files that are refused."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from cli_support import ROOT


def example() -> str:
    """The file of the docs."""
    section = (ROOT / "docs" / "method" / "diagnosis.md").read_text().split("## What you accept")[1]
    block = re.search(r"```json\n(.*?)```", section, re.S)
    assert block
    return block[1]


@pytest.fixture
def camera(ok, tmp_path: Path) -> Path:
    """Photon noise of 0.2 DN per electron, which the simulator has not; so a noise of 4 DN for sqrt(16 + 0.2 * 400)."""
    ok("capture", "make", "camera", "--width", 128, "--height", 96, "--effect", "shot_noise:dn_per_electron=0.2",
       "--seed", 3)  # fmt: skip
    return tmp_path / "camera"


def test_the_docs_example(ok, camera: Path, tmp_path: Path) -> None:
    (tmp_path / "tolerances.json").write_text(example())
    done = ok("diagnose", "camera", "--tolerance", "tolerances.json", "--json", "r.json", "--html", "r.html")
    rows = json.loads((tmp_path / "r.json").read_text())["acceptance"]
    by_name = {(row["sequence"], row.get("quantity", row.get("statistic"))): row for row in rows}
    assert len(rows) == len(by_name)
    noise = by_name["flat", "temporal_noise"]
    assert (noise["unit"], noise["tolerance"]) == ("DN", 0.2)
    assert noise["sim"]["difference"] == pytest.approx(4 - (16 + 0.2 * 400) ** 0.5, abs=0.15)
    assert noise["sim"]["acceptance"] == "not accepted"
    assert noise["sim_with_effects"]["acceptance"] == "accepted"
    low, high = noise["sim_with_effects"]["ci95"]
    assert low < noise["sim_with_effects"]["difference"] < high
    assert by_name["dark", "temporal_noise"]["sim"]["acceptance"] == "accepted"
    signal = by_name["flat", "mean_signal"]
    assert signal["tolerance"] == pytest.approx(0.01 * signal["real"])
    assert signal["sim"]["acceptance"] == "accepted", "light is calibrated"
    assert by_name["board_moving", "contrast"]["region"] == "all"
    assert by_name["board_moving", "contrast"]["sim"]["acceptance"] == "accepted"
    assert by_name[None, "system_gain"]["sim"]["acceptance"] == "not accepted"
    assert "not accepted" in done.out and "Accepted by your tolerances" in done.out
    assert "Accepted by your tolerances" in (tmp_path / "r.html").read_text()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('{"quantities": {"noise": 1}}', ["/quantities/noise is for something that the camera's frames do not tell",
                                          "temporal_noise", "system_gain"]),
        ('{"quantities": {"flat/noise": 1}}', ["flat/temporal_noise", "There are: flat/"]),
        ('{"quantities": {"lamp/temporal_noise": 1}}', ["expected NAME or SEQUENCE/NAME. There are"]),
        ('{"statistics": {"temporal_noise": 1}}', ["SEQUENCE/NAME/REGION", "contrast"]),
        ('{"quantities": {"temporal_noise": -1}}', ["is -1; expected a number of at least 0"]),
        ('{"quantities": {"temporal_noise": "-1 DN"}}', ['is "-1 DN"; expected a number of at least 0']),
        ('{"quantities": {"temporal_noise": "much"}}', ['is "much"; expected a number']),
        ('{"quantities": {"temporal_noise": null}}', ["is null; expected a number"]),
        ('{"quantities": {"temporal_noise": "inf DN"}}', ['is "inf DN"; expected a number']),
        ('{"quantities": {"temporal_noise": "1 px"}}', ['is in "px"; expected "DN", or "%"']),
        ('{"quantities": {"temporal_noise": 1, "temporal_noise": 2}}', ['"quantities.temporal_noise" is given twice']),
        ('{"quantity": {"temporal_noise": 1}}', ['/quantity is not known; expected "quantities" or "statistics"']),
        ('{"quantities": 3}', ["/quantities is 3; expected an object"]),
        ('{"quantities": {}}', ["has no tolerances"]),
        ("[]", ["is no object with tolerances"]),
        ("{", ["is not valid JSON"]),
    ],
)  # fmt: skip
def test_bad_files(refused, ok, tmp_path: Path, text: str, expected: list[str]) -> None:
    ok(
        "capture",
        "make",
        "camera",
        "--width",
        32,
        "--height",
        32,
        "--frames",
        4,
        "--sequences",
        "dark,flat,board_moving",
    )
    (tmp_path / "t.json").write_text(text)
    shown = refused("diagnose", "camera", "--tolerance", "t.json")
    for words in ["t.json", *expected]:
        assert words in shown, shown
    assert "nowhere.json: " in refused("diagnose", "camera", "--tolerance", "nowhere.json")
