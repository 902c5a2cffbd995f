"""Files of JSON that are none are refused by their names, whoever wrote them."""

from __future__ import annotations

from pathlib import Path

import pytest
from gap_check.__main__ import main
from gap_check.json_file import read_json, read_object
from gap_check.runner import read_report

BAD = {
    "deep": (b"[" * 80000, "nested too deep"),
    "twice": (b'{"cause": {"a": 1, "a": 2}}', 'the key "a" is given twice'),
    "no text": (b'{"cause": "\xff"}', "can't decode"),
    "no number": (b'{"cause": NaN}', "NaN is no JSON number"),
    "bytes": (b" " * ((64 << 20) + 1), "more than 67108864 bytes"),
    "cut off": (b'{"cause": [1', "Expecting"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_json_is_refused(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content, words = BAD[name]
    file = tmp_path / "set" / "key.json"
    file.parent.mkdir()
    (file.parent / "capture.json").write_text("{}")
    file.write_bytes(content)
    with pytest.raises(ValueError, match=f"key.json: .*{words}"):
        read_json(file)
    assert read_report(file) is None
    assert main(["score", "--out", str(tmp_path), "--reports", str(tmp_path)]) == 2
    assert words in capsys.readouterr().err
    assert main(["generate", "--plan", str(file), "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err


def test_a_mark_is_taken_and_objects_are_objects(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_bytes(b'\xef\xbb\xbf{"a": 1}')
    assert read_object(tmp_path / "a.json") == {"a": 1}
    (tmp_path / "a.json").write_bytes(b"[1]")
    with pytest.raises(ValueError, match="expected an object"):
        read_object(tmp_path / "a.json")
