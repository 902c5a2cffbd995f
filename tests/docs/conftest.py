"""What the suites of the docs share."""

from __future__ import annotations

from pathlib import Path

import followed
import pytest


@pytest.fixture
def checkout(tmp_path: Path) -> followed.Checkout:
    return followed.Checkout.make(tmp_path)
