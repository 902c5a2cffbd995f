"""JSON from disk: what no program writes is refused with words, in bounded time, wherever the package reads it."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Callable

import numpy as np
import pytest

import clspeckle
from binding_common import ROOT
from clspeckle import _json_file, dataset

SOURCES = Path(clspeckle.__file__).resolve().parent

BAD = {
    "deep": (b"[" * 80000, "nested more than 100 levels"),
    "deep objects": (b'{"a": ' * 80000 + b"1" + b"}" * 80000, "nested more than 100 levels"),
    "twice": (b'{"a": 1, "a": 2}', 'the key "a" is given twice'),
    "twice inside": (b'{"a": [{"b": 1, "b": 2}]}', 'the key "b" is given twice'),
    "no text": (b'{"a": "\xff"}', "no text in UTF-8"),
    "another encoding": ('{"a": 1}'.encode("utf-16"), "no text in UTF-8"),
    "no number": (b'{"a": NaN}', "NaN is no JSON number"),
    "too large": (b'{"a": 1e999}', "1e999 is no number below"),
    "long key": (b'{"' + b"k" * 1025 + b'": 1}', "is longer than 1024 bytes"),
    "values": (b"[" + b"0," * (4 << 20) + b"0]", "holds more than 4194304 values"),
    "bytes": (b" " * ((64 << 20) + 1), "has more than 67108864 bytes"),
    "cut off": (b'{"a": [1, 2', "Expecting"),
    "a zero": (b'{"a": 1}\0', "Extra data"),
    "empty": (b"", "Expecting value"),
}


@pytest.mark.parametrize("name", BAD)
def test_the_reader_refuses(name: str, tmp_path: Path) -> None:
    content, words = BAD[name]
    (tmp_path / "file.json").write_bytes(content)
    with pytest.raises(ValueError, match=words):
        _json_file.read_json(tmp_path / "file.json")


def test_the_reader_takes_what_is_within_its_bounds(tmp_path: Path) -> None:
    deep = b"[" * 100 + b"]" * 100
    for content in (b"\xef\xbb\xbf" + b'{"a": [1, 2.5, null, "\xc3\xa4"]}', deep, b"7", b'{"' + b"k" * 1024 + b'": 1}'):
        (tmp_path / "file.json").write_bytes(content)
        assert _json_file.read_json(tmp_path / "file.json") == json.loads(content.decode("utf-8-sig"))
    with pytest.raises(ValueError, match="nested"):
        _json_file.parse_json(b"[" + deep + b"]")


@pytest.mark.parametrize(("number", "words"), [(b"NaN", "leave what is not known out"), (b"1e999", "or leave it out")])
def test_without_what_was_to_be_left_out_it_is_read(number: bytes, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        _json_file.parse_json(b'{"a": ' + number + b', "b": 1}')
    assert _json_file.parse_json(b'{"b": 1}') == {"b": 1}


def a_set(folder: Path, format: str) -> Path:
    ideal = np.full((8, 10), 0.5, np.float32)
    dataset.write(
        dataset.Recipe(scenes=[ideal], cameras=[{"f_number": 8.0}], effects=[], effects_per_image=(0, 0)),
        folder,
        count=1,
        format=format,
    )
    return folder


def read_design(folder: Path, content: bytes) -> Any:
    np.save(folder / "cell.npy", np.zeros((4, 4), np.float32))
    (folder / "cell.json").write_bytes(content)
    return clspeckle.DoeElement.load(folder / "cell.npy")


def read_recipe(folder: Path, content: bytes) -> Any:
    (folder / "recipe.json").write_bytes(content)
    return dataset.Recipe.from_file(folder / "recipe.json")


def read_description(folder: Path, content: bytes) -> Any:
    (a_set(folder / "set", "webdataset") / "dataset.json").write_bytes(content)
    return dataset.Pairs(folder / "set")


def read_array(folder: Path, content: bytes) -> Any:
    (a_set(folder / "set", "zarr") / "codes" / "zarr.json").write_bytes(content)
    return dataset.Pairs(folder / "set")


READERS: dict[str, Callable[[Path, bytes], Any]] = {
    "design": read_design,
    "recipe": read_recipe,
    "description": read_description,
    "array": read_array,
}


@pytest.mark.parametrize("reader", READERS)
def test_every_file_goes_through_it(reader: str, tmp_path: Path) -> None:
    for number, name in enumerate(("deep", "twice", "no text", "cut off", "values")):
        content, words = BAD[name]
        folder = tmp_path / str(number)
        folder.mkdir()
        with pytest.raises((clspeckle.errors.InvalidArgumentError, clspeckle.errors.InvalidDataError), match=words):
            READERS[reader](folder, content)


def test_no_other_reader_is_used() -> None:
    """json.load() and json.loads() stand in the reader, and where the text is the library's own."""
    own = {"_json_file.py", "capture.py", "diagnosis.py", "profile.py", "tuning.py"}
    # The generator of the check knows nothing of the package.
    own |= {"json_file.py"}
    folders = [SOURCES, ROOT / "validation", ROOT / "examples"]
    paths = [path for folder in folders for path in folder.rglob("*.py")]
    users = {path.name for path in paths if "json.load" in path.read_text(encoding="utf-8")}
    assert users == own


@pytest.mark.parametrize(
    "change",
    [
        {"count": 0},
        {"count": 10**12},
        {"count": True},
        {"count": "1"},
        {"shard_size": 0},
        {"shard_size": 1.5},
        {"with_ideal": 1},
        {"recipe": []},
        {"shard_format": ["zarr"]},
        {"version": 2},
    ],
)
def test_members_of_a_description_are_checked(change: dict[str, Any], tmp_path: Path) -> None:
    folder = a_set(tmp_path / "set", "webdataset")
    there = json.loads((folder / "dataset.json").read_text())
    (folder / "dataset.json").write_text(json.dumps({**there, **change}))
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="no description of a set"):
        dataset.Pairs(folder)


@pytest.mark.parametrize("label", [b"[" * 80000, b"[1]", b'{"index": 0}', b'{"index": 0, "index": 0}', b"{"])
def test_labels_of_pairs_are_checked(label: bytes, tmp_path: Path) -> None:
    folder = a_set(tmp_path / "set", "webdataset")
    (shard,) = folder.glob("*.tar")
    whole = shard.read_bytes()
    at = whole.index(b'{"index"')
    end = whole.index(b"\n", at)
    if len(label) <= end - at:
        shard.write_bytes(whole[:at] + label.ljust(end - at) + whole[end:])
    else:  # in the place of all that follows
        size = whole[:at].rindex(b".json") // 512 * 512 + 124
        shard.write_bytes(whole[:size] + b"%011o\0" % len(label) + whole[size + 12 : at] + label + bytes(10240))
    with pytest.raises(clspeckle.errors.InvalidDataError, match=r"pair 0: .* does not hold it whole"):
        dataset.Pairs(folder)[0]
    os.remove(shard)
