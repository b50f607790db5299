"""What a plan can see, before anything is measured: the sensitivity matrix of its circles [CAL eq 4]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.model.machine_model import MachineModel
from dbbstation.model.simulation import setup_of
from dbbstation.sources.contract import Motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Circle, Plan, PlannedTest
    from dbbstation.sources.contract import ErrorSource

STEP_DEG = 2.0
"""Spacing of the angles at which a plan is looked at: every signature is smooth over this."""

RANK_TOLERANCE = 1e-5
"""Relative singular value below which a direction counts as lost. At the nominal geometry lost ones come out below
1e-14; balls that differ in height by hundredths of a millimetre lift two of them to 1e-6, which no bar could use;
the weakest one that circles really see is at 3e-4 (one height) or 4e-3 (three heights)."""


@dataclass(frozen=True, eq=False)
class PlanSensitivity:
    """Sensitivity matrix of a plan's circles at the nominal geometry.

    Attributes:
        matrix: readings by parameters, shape (n, p), in the products of their units.
        names: source and parameter of each column.
    """

    matrix: NDArray[np.float64]
    names: tuple[tuple[str, str], ...]

    @property
    def singular(self) -> NDArray[np.float64]:
        """Singular values, falling, shape (p,)."""
        return np.asarray(np.linalg.svd(self.matrix, compute_uv=False), dtype=np.float64)

    @property
    def rank(self) -> int:
        singular = self.singular
        return int(np.count_nonzero(singular > RANK_TOLERANCE * singular[0]))

    @property
    def condition(self) -> float:
        singular = self.singular
        return float(singular[0] / singular[self.rank - 1])


def plan_sensitivity(
    machine: Machine, plan: Plan, sources: Sequence[ErrorSource], *, centred: bool = False
) -> PlanSensitivity:
    """Sensitivity of every circle's reading to the parameters of sources, at the nominal geometry.

    Args:
        plan: circles; one direction of each is looked at, since geometry does not know directions.
        centred: remove each circle's centre, as the standard circular test does.

    Raises:
        KinematicsError: a circle that the machine cannot run.
    """
    phi = np.arange(0.0, 360.0, STEP_DEG)
    blocks = []
    for test in plan.tests.values():
        circle = test.run(test.directions[0])
        block = _circle_rows(machine, test, circle, phi, sources)
        blocks.append(_without_centre(block, circle.theta_deg(phi)) if centred else block)
    names = tuple((source.name, p.name) for source in sources for p in source.parameters(machine))
    return PlanSensitivity(np.vstack(blocks), names)


def _circle_rows(
    machine: Machine, test: PlannedTest, circle: Circle, phi_deg: NDArray[np.float64], sources: Sequence[ErrorSource]
) -> NDArray[np.float64]:
    motion = Motion(circle.poses(circle.theta_deg(phi_deg)), is_path=True, setup=setup_of(test))
    reading = MachineModel(machine).bar(motion)
    zero = {source.name: np.zeros(len(source.parameters(machine))) for source in sources}
    return np.hstack([reading.by_source(source, machine, zero[source.name]) for source in sources])


def _without_centre(rows: NDArray[np.float64], theta_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    theta = np.radians(theta_deg)
    centre, _ = np.linalg.qr(np.column_stack([np.cos(theta), np.sin(theta)]))
    return rows - centre @ (centre.T @ rows)
