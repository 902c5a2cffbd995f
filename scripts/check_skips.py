"""Fails if a test was skipped whose reason is not listed.

usage: check_skips.py RESULTS_FOLDER ALLOWED_FILE

RESULTS_FOLDER holds JUnit files of CTest, GoogleTest and pytest. ALLOWED_FILE has a line for each test that may be
skipped: a part of its name, a colon, the reason; # begins a comment.
"""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path


def skipped_tests(results: Path) -> list[str]:
    """Names of all skipped tests in all JUnit files of a folder."""
    names = []
    for file in sorted(results.rglob("*.xml")):
        for case in ElementTree.parse(file).iter("testcase"):
            not_run = case.get("status") in ("notrun", "disabled") or case.get("result") in ("skipped", "suppressed")
            if case.find("skipped") is not None or not_run:
                names.append(f"{case.get('classname', '')}.{case.get('name', '')}")
    return names


def main(results: str, allowed_file: str) -> int:
    lines = (line.split("#")[0].strip() for line in Path(allowed_file).read_text().splitlines())
    allowed = [line.split(":")[0].strip() for line in lines if line]
    skipped = skipped_tests(Path(results))
    unlisted = [name for name in skipped if not any(part in name for part in allowed)]
    print(f"{len(skipped)} tests skipped, {len(unlisted)} of them without a listed reason")
    for name in unlisted:
        print(f"  skipped without a listed reason: {name}")
    return 1 if unlisted else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
