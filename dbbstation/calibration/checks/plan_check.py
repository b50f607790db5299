"""Check whether the tests are redundant enough to reveal a wrong plan."""

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
