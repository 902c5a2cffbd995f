"""The camera that most tests of the generator look through."""

from __future__ import annotations

import pytest

from gap_check.camera import Camera, draw_camera


@pytest.fixture(scope="session")
def camera() -> Camera:
    # f/8: D = 0.386 cycles per pixel, so that the intensity's band (D < 0.5) is sampled without aliasing.
    return draw_camera(11, 128, 128, f_number=8.0)
