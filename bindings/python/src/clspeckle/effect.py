"""The catalogue of effects that make a camera's picture differ from the ideal one.

:meth:`Pipeline.set_effect <clspeckle.Pipeline.set_effect>` switches one on, ``clear_effect`` off again. An effect that
is off costs nothing. Meaning and equations: ``effects.h``, ``docs/reference/effects.md``.
"""

from __future__ import annotations

import ctypes
import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

from . import _check, _library, errors

__all__ = ["Effect", "EffectParameter", "effects"]


@dataclasses.dataclass(frozen=True)
class EffectParameter:
    """One parameter of an effect."""

    name: str
    """For example "waves"."""
    unit: str
    """For example "px" or "DN"; "1" for a plain number."""
    minimum: float
    """Least value accepted."""
    maximum: float
    """Greatest value accepted."""
    weak: float
    """A weak effect, as cameras show it."""
    strong: float
    """A strong one; may be below `weak`."""
    whole: bool = False
    """It counts or numbers something, and must be a whole number."""

    @property
    def middle(self) -> float:
        """Between weak and strong: the value where none is given."""
        return 0.5 * (self.weak + self.strong)


@dataclasses.dataclass(frozen=True)
class Effect:
    """One effect of the catalogue."""

    id: str
    """For example "defocus"."""
    stage: str
    """"laser", "doe", "surface", "motion", "optics" or "sensor"."""
    summary: str
    """What happens."""
    kernel: str
    """File and function that carry it out."""
    parameters: tuple[EffectParameter, ...]
    """In the order in which the C interface takes them."""


@functools.lru_cache(maxsize=1)
def _catalogue() -> dict[str, Effect]:
    """By id. It is the library's, and stays what it is."""
    count = ctypes.c_uint32()
    _library.call("clspEffectGetCount", ctypes.byref(count))
    result = {}
    for index in range(count.value):
        info = _library.ClspEffectInfo()
        _library.call("clspEffectGetInfo", index, ctypes.byref(info))
        parameters = tuple(
            _library.record(EffectParameter, parameter, whole=bool(info.whole_parameters >> place & 1))
            for place, parameter in enumerate(info.parameters[: info.parameter_count])
        )
        effect = _library.record(Effect, info, parameters=parameters)
        result[effect.id] = effect
    return result


def effects() -> list[Effect]:
    """Every effect, in the order in which light meets them. Needs no device; may be called from any thread."""
    return list(_catalogue().values())


def find_effect(value: Any) -> Effect:
    """The effect of an id, or an error that names the nearest one."""
    if isinstance(value, Effect):
        value = value.id
    if not isinstance(value, str):
        raise TypeError(f"effect must be the id of one (see clspeckle.effects()), got {_check.kind(value)}")
    catalogue = _catalogue()
    if value not in catalogue:
        hint = _check.nearest(value, catalogue) or f"; the effects are {', '.join(catalogue)}"
        raise errors.InvalidArgumentError(f"there is no effect {value!r}{hint}")
    return catalogue[value]


def effect_values(effect: Effect, given: Mapping[str, Any]) -> dict[str, float]:
    """All parameters of an effect by name, in order; those that are missing or None take the middle. Their ranges are
    checked by the C library."""
    names = [parameter.name for parameter in effect.parameters]
    for name in given:
        if name not in names:
            hint = _check.nearest(name, names) or f"; it has {', '.join(names)}"
            raise TypeError(f"the effect {effect.id} has no parameter {name!r}{hint}")
    return {
        parameter.name: parameter.middle
        if given.get(parameter.name) is None
        else _check.real(given[parameter.name], parameter.name)
        for parameter in effect.parameters
    }
