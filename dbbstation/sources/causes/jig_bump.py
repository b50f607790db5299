"""A displacement of the jig plate during the session."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import MM_PER_UM, Effect, LinearSource, Motion, Need, Owner, Parameter, Texts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

MOST_RUNS = 120
"""Most runs of a session after which a displacement is tried."""


class JigBump(LinearSource):
    """From one run on, all balls on the table have the same shift.

    One bump is more probable than many balls badly seated in one direction. Between both directions of a test it is
    directly visible.
    """

    name = "jig-bump"
    belongs_to = Owner.SESSION
    needs = frozenset({Need.TIME})
    happens_once = True
    form_uncertainty = 0.05  # the plate turns a little, too
    texts = Texts(
        what="Somebody or something knocked against jig plate or table: from one run on, all balls stand elsewhere.",
        shows="Circles before a certain run and those after it differ by one shift, in all places alike.",
        confirm="Repeat a test from before the bump: its centre has moved by the shift.",
        cure="Clamp the plate better; repeat what was measured before or after it, whichever is less.",
        equation="db = (x, y, z) from run n on, 0 before; runs of the session counted from 0",
        origin="rigid shift of the jig plate",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (
            *(
                Parameter(f"{axis}_um", "µm", 5.0, f"shift of all balls along {axis.upper()}, machine frame")
                for axis in "xyz"
            ),
            Parameter(
                "after_runs",
                "runs",
                1.0,
                "runs of the session before the bump",
                grid=tuple(float(k) for k in range(1, MOST_RUNS)),
                listed=True,
            ),
        )

    def shows(self, motions: Sequence[Motion], nonlinear: Sequence[float]) -> bool:
        after = [_is_after(motion, nonlinear[0]) for motion in motions]
        return any(after) and not all(after)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        self.require(motion)
        return Effect(fixed_ball_mm=MM_PER_UM * np.eye(3, 4) * float(_is_after(motion, values[3])))


def _is_after(motion: Motion, runs: float) -> bool:
    return _number(motion) > runs - 0.5


def _number(motion: Motion) -> int:
    if motion.setup is None or motion.time_s is None or not motion.setup.moving_s:
        return 0
    begins = [begin for begin, _ in motion.setup.moving_s]
    middle_s = float(np.median(motion.time_s))
    return max(int(np.searchsorted(begins, middle_s, side="right")) - 1, 0)
