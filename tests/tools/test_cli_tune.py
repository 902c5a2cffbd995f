"""clspeckle tune: a table, a record, what stands in its way."""

from __future__ import annotations

import json
import signal
import subprocess
from pathlib import Path

import pytest


@pytest.fixture
def record(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    path = tmp_path / "tuning.json"
    monkeypatch.setenv("CLSPECKLE_TUNING", str(path))
    return path


SMALL = ["tune", "--size", "48x40", "--frames", "3"]


def test_a_table_for_eyes_and_a_record(ok, record) -> None:
    out = ok(*SMALL).out
    for words in ("field grid 48 x 40, D = 0.5, medians of 3", "clfft", "cpu", "chosen: ", "of clFFT's"):
        assert words in out
    assert f"written to {record}" in out
    assert [size["width"] for size in json.loads(record.read_text())["records"][0]["sizes"]] == [48]
    ok("tune", "--size", "20x20,16x24", "--frames", "2", "--quiet")
    assert [size["width"] for size in json.loads(record.read_text())["records"][0]["sizes"]] == [16, 20, 48]
    devices = ok("devices").out
    assert "engine at 1024 x 1024: " in devices
    assert f"the tuning record {record}, 48 x 40" in devices


def test_json_and_dry_run(ok, record) -> None:
    result = ok(*SMALL, "--dry-run", "--json").json()
    assert result["path"] == ""
    assert result["warnings"] == []
    (size,) = result["sizes"]
    assert size["chosen"]["engine"] in ("clfft", "cpu", "gpu")
    assert not record.exists()


def test_output_names_the_file(ok, refused, record, tmp_path: Path) -> None:
    other = tmp_path / "other" / "gpu.json"
    assert ok(*SMALL, "--output", other, "--json").json()["path"] == str(other)
    assert not record.exists()
    notes = tmp_path / "notes.txt"
    notes.write_text("dear diary")
    assert "is no tuning record" in refused(*SMALL, "--output", notes)
    assert notes.read_text() == "dear diary"


def test_a_corrupt_record_is_a_warning(ok, record) -> None:
    record.write_text("{")
    run = ok("devices", "--json")
    assert run.err.count("clspeckle: warning: the tuning record") == 1
    assert "is ignored" in run.err
    result = ok(*SMALL, "--json")
    assert any("is replaced" in warning for warning in result.json()["warnings"])
    assert ok("devices").err == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--size", "48"], "expected WIDTHxHEIGHT"),
        (["--size", "0x48"], "expected WIDTHxHEIGHT"),
        (["--size", "48x-1"], "expected WIDTHxHEIGHT"),
        (["--size", "99999x4"], "99999"),
        (["--frames", "0"], "expected an integer from 1 to 10000"),
        (["--dry-run", "--output", "x.json"], "--output"),
    ],
)
def test_bad_options(refused, record, arguments, words) -> None:
    assert words in refused("tune", *arguments)
    assert not record.exists()


def test_a_place_that_cannot_be_written(program, monkeypatch) -> None:
    monkeypatch.setenv("CLSPECKLE_TUNING", "/dev/null/tuning.json")
    run = subprocess.run([program, *SMALL], capture_output=True, text=True, check=False)
    assert run.returncode == 3
    assert "cannot be written to /dev/null/tuning.json" in run.stderr


def test_interrupt_writes_nothing(program, record) -> None:
    with subprocess.Popen(
        [program, "tune", "--size", "512x512", "--frames", "10000"], stderr=subprocess.PIPE, text=True
    ) as process:
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(4)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "interrupted" in err
    assert not record.exists()
