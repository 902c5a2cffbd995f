"""Which engine makes an aperture's transforms the fastest on a device: measured, kept, followed.

    tuning = clspeckle.tune([(1080, 1920)])
    print(tuning.record["sizes"][0]["chosen"], "kept in", tuning.path)

The choice and the record's format: ``docs/guide/runtime.md``; the C interface: ``tuning.h``.
"""

from __future__ import annotations

import ctypes
import dataclasses
import json
import os
from collections.abc import Sequence
from typing import Any

from . import _check, _library, errors
from ._handle import Handle, create
from ._progress import Call, Progress
from .runtime import Context, resolve_context

__all__ = ["Tuning", "explain_engine", "tune", "tuning_record_path"]


@dataclasses.dataclass(frozen=True)
class Tuning:
    """What :func:`tune` measured."""

    record: dict[str, Any]
    """The device, and for each size of this run the candidates with their times, and which was chosen and why."""
    path: str
    """The file that was written, "" if none."""


class _Run(Handle):
    _c_name = "clspTuning"

    def __init__(self, pointer: int | None) -> None:
        self._adopt(pointer)


def tune(
    shapes: Sequence[tuple[int, int]] | None = None,
    *,
    frames: int | None = None,
    relative_diameter: float | None = None,
    keep: bool = True,
    path: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    context: Context | None = None,
) -> Tuning:
    """Measures clFFT and the shapes of the library's own engine, and keeps the fastest in the tuning record.

    Contexts that are made later follow the record. Blocks; whatever else the device does meanwhile spoils the
    measurement.

    Args:
        shapes: (height, width) of images; None: five common ones up to 2048 x 2048.
        frames: measurements of each candidate, 1 to 10000; default 15.
        relative_diameter: of the aperture, above 0 to 1; default 0.5.
        keep: False: nothing is written.
        path: the record's file; None: the one that contexts read.
        progress: called with what is being done and the fraction that is done; returning False cancels: nothing is
            written then.
        context: whose device is measured; the default one without.
    """
    given = {"frames": frames, "relative_diameter": relative_diameter}
    desc = _check.Arguments(_library.ClspTuningDesc).describe(given)
    desc.keep = _check.flag(keep, "keep")
    if shapes is not None:
        pairs = [_check.image_shape(shape) for shape in shapes]
        if not pairs:
            raise errors.InvalidArgumentError("shapes is empty; give at least one (height, width), or None")
        sizes = (_library.ClspTuningSize * len(pairs))(*(_library.ClspTuningSize(w, h) for h, w in pairs))
        desc.sizes, desc.size_count = sizes, len(pairs)
    if path is not None:
        desc.path = _check.path(path, "path")
    device = resolve_context(context)
    call = Call()
    desc.progress = call.progress(progress)
    with call.running():
        run = _Run(create("clspTuningRun", device._get(), ctypes.byref(desc)))
    with run:
        text = _library.text_of("clspTuningGetJson", run._get())
        return Tuning(json.loads(text)["records"][0], _library.text_of("clspTuningGetPath", run._get()))


def explain_engine(shape: tuple[int, int], *, context: Context | None = None) -> str:
    """The engine that an aperture for images of that shape would have first, and why."""
    height, width = _check.image_shape(shape)
    return _library.text_of("clspTuningExplain", resolve_context(context)._get(), width, height)


def tuning_record_path(*, context: Context | None = None) -> str:
    """The file of the user's tuning record, "" where there is none."""
    return _library.text_of("clspTuningGetRecordPath", resolve_context(context)._get())
