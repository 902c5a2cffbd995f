"""What surfaces are made of: how rough, how they change the polarization, how their speckle moves and lives.

A material image (uint8) says for each pixel which entry of the table holds there. Equations: ``material.h``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

from . import _check, _library, errors
from ._handle import Handle, create
from .runtime import Context, resolve_context

__all__ = ["Material", "MaterialTable"]


@dataclasses.dataclass(frozen=True)
class Material:
    """One material. What is None has the C library's default, see :meth:`defaults`."""

    roughness_rms_m: float | None = None
    """RMS height of the surface in metres, >= 0; infinity: fully developed speckle."""
    degree_of_polarization: float | None = None
    """Of the returned light, 0 to 1; negative: that of the aperture."""
    correlation_time_s: float | None = None
    """Time in seconds in which a resting surface's field correlation falls to 1/e; infinity: never, 0: at once."""
    lateral_correlation_length_m: float | None = None
    """Displacement across the viewing direction at which the field correlation has fallen to 1/e, > 0."""
    axial_correlation_length_m: float | None = None
    """Likewise along the viewing direction."""
    rotation_correlation_angle_rad: float | None = None
    """Likewise for rotation."""
    subsurface_fraction: float | None = None
    """Fraction of the light that enters the surface and leaves it elsewhere, 0 to 1."""

    @staticmethod
    def defaults() -> dict[str, Any]:
        """The C library's defaults."""
        return _ARGUMENTS.values(_ARGUMENTS.describe({}), Material.__annotations__)


_ARGUMENTS = _check.Arguments(_library.ClspMaterial)


class MaterialTable(Handle):
    """Immutable; entry i is material id i.

    Args:
        materials: 1 to 256 of :class:`Material`.
        context: None for :func:`default_context`.
    """

    _c_name = "clspMaterialTable"

    def __init__(self, materials: Iterable[Material], *, context: Context | None = None) -> None:
        entries = tuple(materials)
        for i, entry in enumerate(entries):
            if not isinstance(entry, Material):
                raise TypeError(f"materials[{i}] must be a clspeckle.Material, got {_check.kind(entry)}")
        if not 1 <= len(entries) <= _library.CLSP_MAX_MATERIALS:
            raise errors.InvalidArgumentError(
                f"materials has {len(entries)} entries, a table has 1 to {_library.CLSP_MAX_MATERIALS}"
            )
        structs = (_library.ClspMaterial * len(entries))()
        for i, entry in enumerate(entries):
            structs[i] = _ARGUMENTS.describe(vars(entry))
        self.context = resolve_context(context)
        self._adopt(create("clspMaterialTableCreate", self.context._get(), structs, len(entries)))
        self.materials: tuple[Material, ...] = entries

    def __len__(self) -> int:
        return len(self.materials)
