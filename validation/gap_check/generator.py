"""Capture sets in memory and on disk."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .camera import EXPOSURE_MS, SEQUENCES, Camera, Sequence
from .effects import Effects, validate
from .light import intensity
from .scene import ideal_image
from .sensor import Codes, record


def generate_sequence(camera: Camera, sequence: Sequence, effects: Effects, frames: int, seed: int) -> Codes:
    """Codes (frames, height, width) of what is recorded. The same seed gives the same surfaces and noise whatever the
    effects."""
    validate(effects)
    # A lagging sensor remembers what it saw before the first frame.
    exposures = frames + ("image_lag" in effects)
    image = ideal_image(camera, sequence, effects, seed)
    light = intensity(camera, sequence, image, effects, exposures, seed)
    codes = record(camera, sequence, light, effects, frames, seed)
    return np.ascontiguousarray(codes[(slice(None), *camera.recorded)])


def generate_set(
    camera: Camera, effects: Effects, frames: int, seed: int, sequences: tuple[Sequence, ...] = SEQUENCES
) -> Iterator[tuple[Sequence, Codes]]:
    """The sequences of a set, one after another."""
    for sequence in sequences:
        yield sequence, generate_sequence(camera, sequence, effects, frames, seed)


def write_capture(
    folder: Path, camera: Camera, effects: Effects, frames: int, seed: int, sequences: tuple[Sequence, ...] = SEQUENCES
) -> None:
    """capture.json and one array per sequence. capture.json is written last: a folder that has it is complete."""
    folder.mkdir(parents=True, exist_ok=True)
    metadata: dict[str, Any] = camera.metadata()
    metadata["sequences"] = []
    exposed = any(sequence.exposure_ms != EXPOSURE_MS for sequence in sequences)
    for sequence, codes in generate_set(camera, effects, frames, seed, sequences):
        np.save(folder / f"{sequence.name}.npy", codes)
        metadata["sequences"].append(
            {
                "name": sequence.name,
                "file": f"{sequence.name}.npy",
                "scene": sequence.scene,
                "motion": "moving" if sequence.moving else "static",
                **({"exposure_ms": sequence.exposure_ms} if exposed else {}),
            }
        )
    (folder / "capture.json").write_text(json.dumps(metadata, indent=1) + "\n")
