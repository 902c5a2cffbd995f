"""Tuning from Python: a run writes a record, apertures follow it, and a record that is wrong does no harm."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import clspeckle
import numpy as np
import pytest
from clspeckle import errors

SHAPE = (40, 56)


@pytest.fixture
def record(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    path = tmp_path / "folder" / "tuning.json"
    monkeypatch.setenv("CLSPECKLE_TUNING", str(path))
    monkeypatch.delenv("CLSPECKLE_FFT", raising=False)
    return path


def tune(**options) -> clspeckle.Tuning:
    with clspeckle.Context() as context:
        return clspeckle.tune([SHAPE], frames=3, context=context, **options)


def info(shape: tuple[int, int] = SHAPE) -> clspeckle.ApertureInfo:
    with clspeckle.Context() as context:
        return clspeckle.Aperture(shape, relative_diameter=0.5, context=context).info()


def choose(record: Path, engine: dict) -> None:
    """Makes the record say that another of its candidates was the fastest."""
    content = json.loads(record.read_text())
    content["records"][0]["sizes"][0]["chosen"] = engine
    record.write_text(json.dumps(content))


def candidates() -> list[str]:
    """Lanes are none on GPUs."""
    with clspeckle.Context() as context:
        (device,) = {d.type for d in clspeckle.devices() if d.name == context.info().device_name}
    return ["clfft", "gpu"] if "gpu" in device else ["clfft", "cpu", "gpu"]


def test_a_run_writes_what_it_returns(record):
    told: list[tuple[str, float]] = []
    tuning = tune(progress=lambda what, fraction: told.append((what, fraction)))
    assert tuning.path == str(record)
    assert json.loads(record.read_text())["records"] == [tuning.record]
    (size,) = tuning.record["sizes"]
    assert (size["height"], size["width"], size["frames"]) == (*SHAPE, 3)
    engines = [candidate["engine"] for candidate in size["candidates"]]
    assert set(candidates()) <= set(engines)
    assert all(candidate["median_ms"] > 0 for candidate in size["candidates"])
    assert [fraction for _, fraction in told] == sorted(fraction for _, fraction in told)
    assert told[-1][1] == 1.0


@pytest.mark.parametrize("engine", candidates())
def test_the_record_is_followed(record, engine):
    tune()
    choose(record, {"engine": engine})
    got = info()
    assert got.fft_engine == engine
    assert got.fft_source == f"the tuning record {record}, 56 x 40"
    assert (got.column_group is not None) == (engine == "gpu")
    assert info((33, 44)).fft_engine == engine  # the nearest size
    with clspeckle.Context() as context:
        assert clspeckle.explain_engine(SHAPE, context=context) == f"{engine}: {got.fft_source}"
        assert clspeckle.tuning_record_path(context=context) == str(record)


def test_the_environment_comes_first(record, monkeypatch):
    tune()
    choose(record, {"engine": "gpu"})
    monkeypatch.setenv("CLSPECKLE_FFT", "clfft")
    assert (info().fft_engine, info().fft_source) == ("clfft", "CLSPECKLE_FFT is clfft")


def test_engines_of_a_record_make_the_same_picture(record):
    tune()
    pictures = []
    for engine in candidates():
        choose(record, {"engine": engine})
        with clspeckle.Context() as context:
            state = clspeckle.Phase(SHAPE, seed=3, context=context)
            state.refresh(0)
            aperture = clspeckle.Aperture(SHAPE, relative_diameter=0.5, context=context)
            assert aperture.info().fft_engine == engine
            pictures.append(np.array(aperture.intensity(state, np.ones(SHAPE, np.float32)), float))
    for picture in pictures[1:]:
        assert np.linalg.norm(picture - pictures[0]) < 2e-6 * np.linalg.norm(pictures[0])


def test_old_names_of_a_record_are_read_with_a_warning(record, caplog):
    tune()
    choose(record, {"engine": "gpu"})
    record.write_text(record.read_text().replace('"gpu"', '"fused-groups"').replace('"cpu"', '"fused-lanes"'))
    assert info().fft_engine == "gpu"
    (warning,) = [line.getMessage() for line in caplog.records if line.levelno == logging.WARNING]
    assert warning.startswith(f"the tuning record {record} has old names: fused-lanes is called cpu, fused-groups gpu")
    tune()
    assert "fused" not in record.read_text()


def test_another_driver_is_not_followed(record, caplog):
    tune()
    choose(record, {"engine": "clfft"})
    content = json.loads(record.read_text())
    content["records"][0]["device"]["driver_version"] = "0.1"
    record.write_text(json.dumps(content))
    with caplog.at_level(logging.INFO, logger="clspeckle"):
        assert str(record) not in info().fft_source
    assert any("with driver 0.1" in line for line in caplog.messages)
    assert len(json.loads(record.read_text())["records"]) == 1
    tune()  # beside it
    assert len(json.loads(record.read_text())["records"]) == 2


@pytest.mark.parametrize("content", [b"", b"{", b"\x00" * 100, b'{"format": "clspeckle-tuning", "format_version": 9}'])
def test_a_corrupt_record_is_ignored_with_one_warning_and_renewed(record, caplog, content):
    record.parent.mkdir()
    record.write_bytes(content)
    with clspeckle.Context() as context:
        for _ in range(2):
            got = clspeckle.Aperture(SHAPE, relative_diameter=0.5, context=context).info()
            assert str(record) not in got.fft_source
    (warning,) = [line for line in caplog.records if line.levelno == logging.WARNING]
    assert warning.name == "clspeckle"
    assert f"the tuning record {record} is ignored" in warning.getMessage()
    caplog.clear()
    tune()
    assert [line for line in caplog.messages if "is replaced" in line]
    caplog.clear()
    assert str(record) in info().fft_source
    assert not [line for line in caplog.records if line.levelno == logging.WARNING]


def test_a_folder_in_its_place_is_a_warning_too(record, caplog):
    record.mkdir(parents=True)
    assert str(record) not in info().fft_source
    assert "is no file that can be read" in caplog.text
    with pytest.raises(errors.InputOutputError, match="cannot be written"):
        tune()


def test_shipped_records_speak_where_the_user_has_none(record):
    """A record that was measured on this kind of device, if one came with the library; else the default."""
    source = info((1024, 1024)).fft_source
    assert source.startswith(("the shipped tuning record ", "the default for CPUs", "the default for GPUs"))


def test_records_off(record, monkeypatch):
    tune()
    choose(record, {"engine": "clfft"})
    monkeypatch.setenv("CLSPECKLE_TUNING", "off")
    assert "record" not in info().fft_source
    with clspeckle.Context() as context:
        assert clspeckle.tuning_record_path(context=context) == ""
    assert tune(keep=False).path == ""


def test_the_cache_folder_is_the_default_place(record, monkeypatch, tmp_path):
    monkeypatch.delenv("CLSPECKLE_TUNING")
    with clspeckle.Context(cache_dir=tmp_path / "cache") as context:
        assert clspeckle.tuning_record_path(context=context) == str(tmp_path / "cache" / "tuning.json")
    monkeypatch.setenv("CLSPECKLE_CACHE_DIR", str(tmp_path / "variable"))
    with clspeckle.Context() as context:
        assert clspeckle.tuning_record_path(context=context) == str(tmp_path / "variable" / "tuning.json")


def test_cancelling_and_errors_of_the_progress_function_write_nothing(record):
    with pytest.raises(errors.CancelledError):
        tune(progress=lambda _what, fraction: fraction < 0.3)
    assert not record.exists()

    def broken(_what: str, _fraction: float) -> bool:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        tune(progress=broken)
    assert not record.exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"shapes": []}, "shapes is empty"),
        ({"shapes": [(0, 4)]}, "at least 1"),
        ({"shapes": [(4, 4)], "frames": 0}, "frames is 0"),
        ({"shapes": [(4, 4)], "relative_diameter": 2.0}, "relative_diameter is 2"),
        ({"shapes": [(4, 4)] * 65}, "65"),
        ({"shapes": [(4, 4)], "keep": False, "path": "x.json"}, "keep is 0"),
    ],
)
def test_bad_input(record, options, words):
    with pytest.raises(errors.InvalidArgumentError, match=words):
        clspeckle.tune(**options)
    with pytest.raises(TypeError):
        clspeckle.tune([SHAPE], keep="yes")
