"""Error source: play of the strut drives at reversal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import (
    SMOOTH_MM,
    Effect,
    Motion,
    Need,
    Owner,
    SourceWithHistory,
    Texts,
    of_each_strut,
)
from dbbstation.sources.laws.play_operator import PlayState, followed, leaning

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Parameter

MM_PER_UM = 1e-3


class Backlash(SourceWithHistory):
    """After a reversal a strut stays behind by its play, and goes on only when the drive has travelled through it.

    With x the commanded travel of a strut and w its play, the strut stands at y, which the drive takes along at
    either end of the play: y_k = y_{k-1} limited to x_k - w/2 ... x_k + w/2. The error y - x is -w/2 while the strut
    grows and +w/2 while it shrinks, and passes from one to the other over a travel of w. The friction wind-up of an
    elastic drive has the same form.

    A run is taken to begin in a movement that was already under way. A negative w is a strut that overshoots at
    reversal; the effect is that of |w| with its sign turned, so that a fit may pass through zero.
    """

    name = "backlash"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    needs = frozenset({Need.POSE, Need.PATH})
    varies_with = "strut-speed-sign"
    form_uncertainty = 0.2  # friction and wear differ along the screw and between directions, as play does
    texts = Texts(
        what="A strut's drive has play, or winds up against friction, each time the strut turns from growing to "
        "shrinking.",
        shows="A step in the circle where one strut turns round, not where X or Y does; clockwise and "
        "counter-clockwise runs differ by the play, however well the machine is calibrated.",
        confirm="Put a dial gauge or a linear scale on that strut, move it by 0.1 mm to and fro and compare with its "
        "encoder.",
        cure="Tighten or exchange nut, bearing or joint of that strut; until then enter its backlash in the control.",
        equation="actual minus driven length: y - x, y_k = min(max(y_k-1, x_k - w/2), x_k + w/2)",
        origin="play operator (hysteresis of play, Krasnosel'skii and Pokrovskii 1983), of each strut's travel",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        """Six plays, full width."""
        return of_each_strut("strut_{}_um", "µm", 3.0, "play of strut {}, whole width; positive: it stays behind")

    def begin(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> PlayState:  # noqa: ARG002
        """Which end of its play each strut leans on.

        Raises:
            ModelError: the motion is no path.
        """
        self.require(motion)
        return leaning(motion.struts(machine).length_mm)

    def advance(
        self, motion: Motion, machine: Machine, values: NDArray[np.float64], state: PlayState
    ) -> tuple[Effect, PlayState]:
        """Lag of each strut."""
        lag, _, behind = self._lag(motion, machine, values, state)
        return Effect(strut_mm=lag), behind

    def derivative(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:
        """Each strut answers to its own play; analytic but for the samples at which a strut is taken along again.

        Raises:
            ModelError: the motion is no path.
        """
        _, by_width, _ = self._lag(motion, machine, values, self.begin(motion, machine, values))
        return Effect(strut_mm=MM_PER_UM * by_width[:, :, None] * np.eye(STRUTS))

    def _lag(
        self, motion: Motion, machine: Machine, values: NDArray[np.float64], state: PlayState
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], PlayState]:
        """Lag [mm] and its derivative by the width [mm/mm], shapes (n, 6), and the state behind the last row."""
        lag, by_width, behind = followed(motion.struts(machine).length_mm, MM_PER_UM * np.abs(values), state)
        return np.where(values < 0.0, -lag, lag), by_width, behind
