"""Whether the tests are enough to check the plan that they were run by: its tilts, heights and places."""

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
    """Redundancy of the tests.

    Each circle by itself determines some directions of the parameters. What all circles determine, less what the fit
    uses up, are the degrees of freedom that can contradict the plan.

    Attributes:
        determined: directions that single tests determine, summed over the tests.
        identified: directions that all tests together determine.
        of_one_test: directions that the test that shows most determines.
    """

    tests: int
    determined: int
    identified: int
    of_one_test: int

    @computed_field  # type: ignore[prop-decorator]
    @property
    def left(self) -> int:
        """Degrees of freedom that are left to check the plan."""
        return self.determined - self.identified

    @computed_field  # type: ignore[prop-decorator]
    @property
    def enough(self) -> bool:
        """Whether the tests can show a wrong plan.

        As much as one whole circle shows must be left: then a circle that was run otherwise than planned cannot be
        explained by parameters that the others determine anyway. Three circles leave 3 to 5, four leave 12, one shows 9.
        """
        return self.left >= self.of_one_test


@with_one_thread
def check_plan(calibration: Calibration) -> PlanCheck:
    """Count the directions that tests determine, judged by the noise of the fit; tolerances of the machine file do not count."""
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
