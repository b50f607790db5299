"""Check whether the tests are redundant enough to reveal a wrong plan, and which tests would determine lost directions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import computed_field

from dbbstation.computing.threads import with_one_thread
from dbbstation.inference.square_root import lost_directions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.inference.blocks import Block


@dataclass(frozen=True)
class PlanCheck:
    """Redundancy of the tests."""

    tests: int
    determined: int
    identified: int
    of_one_test: int

    @computed_field  # type: ignore[prop-decorator]
    @property
    def left(self) -> int:
        """Return the remaining degrees of freedom."""
        return self.determined - self.identified

    @computed_field  # type: ignore[prop-decorator]
    @property
    def enough(self) -> bool:
        """Return whether the tests can show a wrong plan."""
        return self.left >= self.of_one_test


@with_one_thread
def check_plan(calibration: Calibration) -> PlanCheck:
    """Count the directions that tests determine at the fit's noise, without tolerances of the machine file."""
    known = calibration.layout.known
    free = replace(known, prior=np.where(calibration.layout.bounded, np.inf, known.prior))
    fitted = int(np.count_nonzero(~known.random))

    def determined(blocks: Sequence[Block]) -> int:
        return fitted - len(lost_directions(blocks, free, calibration.noise.effective))

    by_test: dict[tuple[str, str], list[Block]] = {}
    for run, block in zip(calibration.observations, calibration.circle_blocks, strict=True):
        by_test.setdefault((run.setup.session, run.test), []).append(block)
    each = [determined(blocks) for blocks in by_test.values()]
    return PlanCheck(len(each), sum(each), determined(calibration.circle_blocks), max(each))


APART_MM = 20.0
"""Smaller height differences count as one height [mm]."""

TILTED_DEG = 2.0
"""Smaller orientation differences count as one orientation [deg]."""


def gaps(calibration: Calibration) -> tuple[str, ...]:
    """Return texts on the measurements that would determine lost directions; may be empty."""
    # The fifteen circles of [CAL Table II] lose only the common height, which raised bars determine. Circles at one
    # height lose three directions; circles in one orientation lose most of the others.
    lost = len(calibration.directions_lost) + len(calibration.directions_regularised)
    if lost == 0:
        return ()
    runs = calibration.observations
    if any(not run.setup.place_known for run in runs):
        return ("balls put up under the spindle say nothing of the machine's place and tilt on the table",)
    found = []
    if lost > 1 and float(np.ptp([run.raw.circle.ball_mm[2] for run in runs])) < APART_MM:
        found.append("the balls of all tests stand at one height: add tests on a longer holder, at two more levels")
    if lost > 1 and float(np.ptp([run.raw.circle.tilt_deg for run in runs], axis=0).max()) < TILTED_DEG:
        found.append("all tests have one orientation: add tests with the platform tilted by 10 degrees or more")
    if lost > 1 and not found:
        tests = len({(run.setup.session, run.test) for run in runs})
        found.append(
            f"{tests} tests lose {lost} directions where the fifteen circles of the jig plan lose one: add places, "
            "levels and tilts"
        )
    if all(run.raw.circle.elevation_deg == 0.0 for run in runs):
        found.append("no test has a raised bar: five with elevation_deg: 5 show the height of the machine too")
    return tuple(found)
