"""Follows the tutorials to the letter, and copies the picture that each ends in to docs/images/tutorials.

.venv/bin/python docs/figures/tutorials.py [NAME ...]      # about a minute
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "docs"))

import followed  # noqa: E402

PAGES = sorted((ROOT / "docs" / "tutorials").glob("*.md"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="of the tutorials; all without")
    names = parser.parse_args().names
    for page in PAGES:
        if page.stem == "index" or (names and page.stem not in names):
            continue
        with tempfile.TemporaryDirectory() as folder:
            checkout = followed.Checkout.make(Path(folder))
            print(page.stem, checkout.follow(page))
            shutil.copyfile(
                Path(folder) / f"{page.stem}.png", ROOT / "docs" / "images" / "tutorials" / f"{page.stem}.png"
            )


if __name__ == "__main__":
    main()
