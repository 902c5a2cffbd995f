"""The one reader of JSON files: plans, keys, reports and notes of runs may come from anybody."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

MOST_BYTES = 64 << 20


def read_json(path: Path) -> Any:
    """What a file holds. OSError: it cannot be read; ValueError with its name: it is no JSON in UTF-8 (with or without
    a byte order mark), too large, nested too deep, or gives a key twice."""
    with path.open("rb") as file:
        content = file.read(MOST_BYTES + 1)
    try:
        if len(content) > MOST_BYTES:
            raise ValueError(f"more than {MOST_BYTES} bytes")
        return json.loads(content.decode("utf-8-sig"), object_pairs_hook=_members, parse_constant=_no_constant)
    except RecursionError:
        raise ValueError(f"{path}: nested too deep") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def read_object(path: Path) -> dict[str, Any]:
    """The same; anything but an object is refused."""
    content = read_json(path)
    if not isinstance(content, dict):
        raise ValueError(f"{path}: expected an object")
    return content


def _members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        seen: set[str] = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise ValueError(f'the key "{twice}" is given twice')
    return result


def _no_constant(word: str) -> None:
    raise ValueError(f"{word} is no JSON number")
