"""The one reader of JSON from disk. What it may ask for is bounded, as in the program (io/json_file.hpp)."""

from __future__ import annotations

import collections
import json
import math
import os
from typing import Any

MOST_BYTES = 64 << 20
MOST_VALUES = 4 << 20
MOST_LEVELS = 100
MOST_KEY_BYTES = 1024


def read_json(path: str | os.PathLike[str]) -> Any:
    """What a JSON file holds.

    Raises:
        OSError: it cannot be read.
        ValueError: it is no JSON in UTF-8 (with or without a byte order mark), goes beyond the bounds above, or gives a
            key twice.
    """
    with open(path, "rb") as file:
        return parse_json(file.read(MOST_BYTES + 1))


def parse_json(content: bytes) -> Any:
    """The same of bytes that were read."""
    if len(content) > MOST_BYTES:
        raise ValueError(f"the JSON has more than {MOST_BYTES} bytes; at most so many are taken")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError("the JSON is no text in UTF-8: save it in that encoding") from None
    # Before each value but the first there is one of these; texts may hold some more.
    if text.count(",") + text.count("[") + text.count("{") >= MOST_VALUES:
        raise ValueError(f"the JSON holds more than {MOST_VALUES} values; at most so many are taken: split the file")
    try:
        result = json.loads(text, object_pairs_hook=_members, parse_constant=_no_constant, parse_float=_finite)
    except RecursionError:
        raise _too_deep() from None
    level = [result] if isinstance(result, (dict, list)) else []
    for _ in range(MOST_LEVELS):
        inner = (value.values() if isinstance(value, dict) else value for value in level)
        level = [value for values in inner for value in values if isinstance(value, (dict, list))]
    if level:
        raise _too_deep()
    return result


def _too_deep() -> ValueError:
    return ValueError(f"the JSON is nested more than {MOST_LEVELS} levels deep")


def _members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """JSON leaves open which of two equal keys counts, so neither is taken."""
    result = dict(pairs)
    for key in result:
        if len(key) > MOST_KEY_BYTES // 4 and len(key.encode(errors="replace")) > MOST_KEY_BYTES:
            raise ValueError(f"the key {key[:40]!r} ... is longer than {MOST_KEY_BYTES} bytes, the most")
    if len(result) != len(pairs):
        twice = collections.Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f'the key "{twice}" is given twice; keep one of them')
    return result


def _no_constant(word: str) -> None:
    raise ValueError(f"{word} is no JSON number; leave what is not known out")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text} is no number below 1.8e308: correct it, or leave it out")
    return number
