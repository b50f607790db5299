"""Play of the strut drives at reversal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.laws.play import EQUATION, FORM_UNCERTAINTY, PlayState, followed, leaning
from dbbstation.laws.presliding import DAHL, WIND_UP, WoundState, wound, wound_up
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import (
    MM_PER_UM,
    SMOOTH_MM,
    Effect,
    Motion,
    Need,
    Owner,
    Parameter,
    SourceWithHistory,
    Texts,
    of_each_strut,
    of_own_strut,
)
from dbbstation.sources.laws.unlike_struts import of_several_lengths

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class Backlash(SourceWithHistory):
    """After a reversal a strut stands still until the drive has crossed its play.

    For commanded travel x and play w, y_k is y_{k-1} limited to x_k - w/2 ... x_k + w/2. The error y - x is -w/2 while
    growing, +w/2 while shrinking. Wind-up against friction reaches these limits over a longer travel (`_WoundUp`).

    A run begins in motion. Negative w inverts the effect of |w|, so a fit may pass zero.
    """

    name = "backlash"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    needs = frozenset({Need.POSE, Need.PATH})
    varies_with = "strut-speed-sign"
    form_uncertainty = FORM_UNCERTAINTY
    texts = Texts(
        what="A strut's drive has play, or winds up against friction, each time the strut turns from growing to "
        "shrinking.",
        shows="A step in the circle where one strut turns round, not where X or Y does; clockwise and "
        "counter-clockwise runs differ by the play, however well the machine is calibrated.",
        confirm="Put a dial gauge or a linear scale on that strut, move it by 0.1 mm to and fro and compare with its "
        "encoder.",
        cure="Tighten or exchange nut, bearing or joint of that strut; until then enter its backlash in the control.",
        equation=f"actual minus driven length: y - x, {EQUATION}; or, where a drive winds up over a length l, w z, {WIND_UP}",
        origin="play operator (hysteresis of play, Krasnosel'skii and Pokrovskii 1983), of each strut's travel; wind-up: "
        + DAHL,
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return of_each_strut("strut_{}_um", "µm", 3.0, "play of strut {}, whole width; positive: it stays behind")

    def begin(self, motion: Motion, machine: Machine, values: Floats) -> PlayState:  # noqa: ARG002
        self.require(motion)
        return leaning(motion.struts(machine).length_mm)

    def advance(self, motion: Motion, machine: Machine, values: Floats, state: PlayState) -> tuple[Effect, PlayState]:
        lag, _, behind = self._lag(motion, machine, values, state)
        return Effect(strut_mm=lag), behind

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        _, by_width, _ = self._lag(motion, machine, values, self.begin(motion, machine, values))
        return Effect(strut_mm=of_own_strut(MM_PER_UM * by_width))

    def _lag(
        self, motion: Motion, machine: Machine, values: Floats, state: PlayState
    ) -> tuple[Floats, Floats, PlayState]:
        lag, by_width, behind = followed(motion.struts(machine).length_mm, MM_PER_UM * np.abs(values), state)
        return np.where(values < 0.0, -lag, lag), by_width, behind


LENGTHS_MM = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32)
"""Tried lengths of wind-up [mm]: presliding of screws, seals and joints takes some hundredths to tenths of a millimetre."""

AHEAD = 1.1
"""Least length of a wind-up over its width. With 1 a reversing strut would first stand still; with less it would move
against its drive. With 1.1 it follows the drive, so the error can be compensated."""


class _WoundUp(SourceWithHistory, law="wind-up", law_of=Backlash, extends=Backlash):
    """Drive friction reverses over a travel: presliding by Dahl's law.

    For direction s, travel x and width w the error is w z with dz = -(s/2 + z) |dx| / l. At the distance d after a
    reversal of a fully wound strut it is -s w (1/2 - exp(-d / l)).
    """

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        widths = of_each_strut("strut_{}_um", "µm", 3.0, "wind-up of strut {}, whole width; positive: it stays behind")
        meaning = "travel of a strut over which 37 % of a turn-round are left, all struts alike"
        return (*widths, Parameter("wind_up_length_mm", "mm", 0.05, meaning, LENGTHS_MM))

    def begin(self, motion: Motion, machine: Machine, values: Floats) -> WoundState:  # noqa: ARG002
        self.require(motion)
        return wound(motion.struts(machine).length_mm)

    def advance(self, motion: Motion, machine: Machine, values: Floats, state: WoundState) -> tuple[Effect, WoundState]:
        side, _, behind = wound_up(motion.struts(machine).length_mm, _lengths(values)[0], state)
        return Effect(strut_mm=side * MM_PER_UM * values[:STRUTS]), behind

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        length, is_stated = _lengths(values)
        width = MM_PER_UM * values[:STRUTS]
        start = self.begin(motion, machine, values)
        side, by_length, _ = wound_up(motion.struts(machine).length_mm, length, start)
        longer = np.where(is_stated, 0.0, AHEAD * np.sign(width))
        own = of_own_strut(MM_PER_UM * (side + width * longer * by_length))
        return Effect(strut_mm=np.concatenate([own, (width * is_stated * by_length)[:, :, None]], axis=2))

    def left_open(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        return of_several_lengths(self, motion, machine, values)


def _lengths(values: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    least = np.maximum(AHEAD * MM_PER_UM * np.abs(values[:STRUTS]), 1e-9)
    return np.maximum(values[STRUTS], least), values[STRUTS] >= least
