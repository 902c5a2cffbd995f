"""What the suites of the docs share."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import followed
import pytest


@pytest.fixture
def checkout(tmp_path: Path) -> followed.Checkout:
    return followed.Checkout.make(tmp_path)


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    environment = {**os.environ, "CLSP_PYTHON": sys.executable}
    done = subprocess.run(
        ["bash", followed.ROOT / "scripts" / "docs.sh", folder],
        capture_output=True, text=True, check=False, env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return folder
