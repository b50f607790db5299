"""Error sources made of laws over columns, which lengthen or shorten every strut."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dbbstation.laws.contract import MOVING, SourceForm, TableSource
from dbbstation.laws.memory import SHORTEST_S
from dbbstation.machine.geometry import STRUT_NUMBERS, STRUTS
from dbbstation.sources.contract import MM_PER_UM, Effect, ErrorSource, Need, Owner, Parameter
from dbbstation.sources.laws.motion import since_turning

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Motion

SHAPE_STEP = 1e-4
"""Half step of the derivative by a nonlinear parameter, relative to its usual size."""

_NEEDS = {
    "t_s": {Need.TIME},
    "position_mm": set(),
    "speed_mm_s": {Need.PATH, Need.TIME},
    "acceleration_mm_s2": {Need.PATH, Need.TIME},
    "direction": {Need.PATH},
    "since_reversal_mm": {Need.PATH},
}
_VARIES_WITH = {"position": "strut-length", "speed": "strut-speed", "acceleration": "strut-acceleration"}


def of_struts(law: type[TableSource]) -> type[ErrorSource]:
    """Return an error source's class for a law over the columns of `MOVING`.

    The law's effect is in µm of a strut's length; struts have separate amplitudes, but common nonlinear parameters.
    """
    needs = getattr(law, "needs", ())
    variable = MOVING[getattr(law, "follows", "") or next(iter(needs), "t_s")]
    own = {
        "__module__": law.__module__,
        "__doc__": law.__doc__,
        "of": law,
        "name": getattr(law, "name", ""),
        "texts": getattr(law, "texts", None),
        "form_uncertainty": law.form_uncertainty,
        "needs": frozenset({Need.POSE}.union(*(_NEEDS[name] for name in needs))),
        "varies_with": _VARIES_WITH.get(variable, variable),
    }
    return type(law.__name__, (_OfStruts,), own)


class _OfStruts(ErrorSource):
    of: ClassVar[type[TableSource]]
    belongs_to = Owner.MACHINE

    def __init__(self) -> None:
        law = self.of()
        self._form = SourceForm(law.parameters(), law.columns)

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        sizes = [
            replace(p, name=f"strut_{k}_{p.name}", meaning=f"{p.meaning}, strut {k}", strut=k)
            for p in self._form.amplitudes
            for k in STRUT_NUMBERS
        ]
        return (*sizes, *self._form.shapes)

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        effects, sizes = self._effects(motion, machine, values)
        return Effect(strut_mm=np.einsum("nsp,ps->ns", effects, sizes))

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        effects, sizes = self._effects(motion, machine, values)
        by_size = (effects[:, :, :, None] * np.eye(STRUTS)[:, None, :]).reshape(len(motion), STRUTS, sizes.size)
        by_shape = [self._by_shape(motion, machine, values, k) for k in range(sizes.size, len(values))]
        return Effect(strut_mm=np.concatenate([by_size, *(each[:, :, None] for each in by_shape)], axis=2))

    def _by_shape(self, motion: Motion, machine: Machine, values: Floats, which: int) -> Floats:
        step = np.zeros(len(values))
        step[which] = SHAPE_STEP * self.parameters(machine)[which].plausible
        more, less = (self.effect(motion, machine, values + way * step).strut_mm for way in (1.0, -1.0))
        return np.asarray((more - less) / (2.0 * step[which]))  # type: ignore[operator] # an effect of this class has lengths

    def _effects(self, motion: Motion, machine: Machine, values: Floats) -> tuple[Floats, Floats]:
        """Return the effect of unit amplitudes, shape (n, 6, p) [mm], and the amplitudes, shape (p, 6).

        Parameters beyond a limit are set to it.
        """
        self.require(motion)
        sizes, shapes = np.split(values, [len(values) - len(self._form.shapes)])
        columns = motion.once("moving columns", machine, lambda: moving_columns(motion, machine))
        point = [float(np.clip(value, *p.limits)) for p, value in zip(self._form.shapes, shapes, strict=True)]
        needed = [{name: columns[name][:, k] for name in self.of.needs} for k in range(STRUTS)]
        effects = np.stack([self._form.at(one, point) for one in needed], axis=1)
        return MM_PER_UM * effects, sizes.reshape(-1, STRUTS)


def moving_columns(motion: Motion, machine: Machine) -> dict[str, Floats]:
    """Return a motion's columns of `MOVING`, shape (n, 6) each, computed from earlier rows only.

    Rates are backward differences. A strut at rest keeps its last direction.
    """
    length = motion.struts(machine).length_mm
    found = {"position_mm": length}
    if motion.is_path:
        since = np.abs(since_turning(length))
        found["since_reversal_mm"] = np.where(np.maximum.accumulate(since, axis=0) > 0.0, since, np.inf)
        found["direction"] = _held(np.sign(np.diff(length, axis=0, prepend=length[:1])))
    if motion.time_s is not None:
        found["t_s"] = np.repeat(motion.time_s[:, None], STRUTS, axis=1)
    if motion.is_path and motion.time_s is not None:
        found["speed_mm_s"] = _rate(motion.time_s, length)
        found["acceleration_mm_s2"] = _rate(motion.time_s, found["speed_mm_s"])
    return found


def _rate(time_s: Floats, values: Floats) -> Floats:
    step = np.diff(time_s)
    later = step > SHORTEST_S
    rate = np.full_like(values, np.nan)
    rate[1:][later] = np.diff(values, axis=0)[later] / step[later, None]
    return _held(np.nan_to_num(rate, nan=0.0), ~np.isnan(rate))


def _held(values: Floats, known: Floats | None = None) -> Floats:
    """Fill unknown rows with the last known value, initially with the first known one, shape (n, m)."""
    there = values != 0.0 if known is None else known
    rows = np.arange(len(values))[:, None]
    last = np.maximum.accumulate(np.where(there, rows, -1), axis=0)
    first = np.where(there.any(axis=0), there.argmax(axis=0), 0)
    return np.take_along_axis(values, np.where(last < 0, first, last), axis=0)
