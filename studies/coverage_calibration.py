"""Coverage of calibrated parameters and of predicted positions, with sessions of the independent virtual machine of tests/plant.

Each draw is a machine, its session in a folder, `calibrate` on it, and `predict` with the model; the truth is the generator's.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES, MEASUREMENT_SOURCES, calibrate
from dbbstation.calibration.reporting.identified import identified_model
from dbbstation.errors import CalibrationError
from dbbstation.files.formats.model import read_model, write_model
from dbbstation.model.uncertainty import predicted_poses
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.tasks.load import load_sessions
from studies.coverage_rows import row_of
from studies.kept_draws import drawn
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.noise import Noise
from tests.plant.plan import elevated, table_ii_plan
from tests.plant.session import record

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.model.identified import IdentifiedModel
    from studies.coverage_rows import Row
    from tests.plant.truth import Truth

TOLERANCE_MM = 0.05
"""Standard deviation of a base joint's coordinate, and of strut lengths, of the machines that are drawn."""

NOISES = tuple(
    Noise(white_um=0.6 * size, correlated_um=0.8 * size if coloured else 0.0)
    for size in (0.3, 1.0, 3.0)
    for coloured in (False, True)
)
"""Of readings, in turn: three sizes, white and correlated from sample to sample by 0.6."""

RATE_HZ = 2.0
RAISED_DEG, RAISED = 5.0, "abcde"
POSES = 12
REACH_MM, REACH_DEG, MIDDLE_MM = 150.0, 10.0, -1008.0
COMPLIANCE_UM_KN = 9.68

OF_A_FORMULA = "u holds the 2 % by which real struts depart from the formula; the generator's follow it exactly"


@dataclass(frozen=True)
class Case:
    """Circumstances of a calibration.

    Attributes:
        name: in words.
        raised: whether five bars are raised, which shows the height of the base.
        tolerance: whether the machine file states the tolerance of joints.
        gravity: whether struts are elastic, and their compliance fitted.
    """

    name: str
    raised: bool
    tolerance: bool
    gravity: bool = False


CASES = (
    Case("level bars, tolerance unknown", raised=False, tolerance=False),
    Case("level bars, tolerance known", raised=False, tolerance=True),
    Case("raised bars, tolerance unknown", raised=True, tolerance=False),
    Case("raised bars, tolerance known", raised=True, tolerance=True),
    Case("raised bars, gravity fitted", raised=True, tolerance=False, gravity=True),
)

Figures = dict[str, tuple[list[float], list[float | None]]]
"""Found less true values of one draw and their stated standard uncertainties, by figure; None where none is stated."""

FIGURES = (
    "strut lengths",
    "base joints X",
    "base joints Y",
    "base joints Z",
    "compliance",
    *(f"predicted {a}" for a in "XYZ"),
)


def coverage_of_calibration(
    cases: Sequence[Case],
    seeds: range,
    progress: Callable[[int], None] = lambda _done: None,
    keep: Path | None = None,
) -> list[Row]:
    """Draw machines, record, calibrate, predict, and compare with what was drawn.

    Args:
        cases: circumstances; each sees all machines, and they take turns.
        seeds: of the machines.
        progress: called with how many sessions are done.
        keep: file of the draws; None where none are kept.
    """
    what = f"calibrations, {'; '.join(case.name for case in cases)}, from seed {seeds.start}"
    results = drawn(partial(_numbered, tuple(cases), seeds.start), range(len(seeds) * len(cases)), keep, what)
    by_case: list[list[Figures]] = [[] for _ in cases]
    for number, result in enumerate(results):
        if result:
            by_case[number % len(cases)].append(result)
        progress(number + 1)
    rows = []
    for case, found in zip(cases, by_case, strict=True):
        for figure in FIGURES:
            if figure not in found[0]:
                continue
            # JSON has no NaN: what is not stated is null there.
            off, u = (np.array([one[figure][k] for one in found], dtype=np.float64) for k in (0, 1))
            reason = OF_A_FORMULA if case.gravity and (figure == "compliance" or "predicted" in figure) else ""
            unit, scale = ("µm/kN", 1.0) if figure == "compliance" else ("µm", 1e3)
            rows.append(row_of(case.name, figure, scale * off, scale * u, unit, reason))
    return rows


def _numbered(cases: Sequence[Case], seed: int, number: int) -> Figures:
    """One draw by its number: cases take turns with each seed; empty where the fit says that it found no end, and states nothing."""
    try:
        found = drawn_figures(cases[number % len(cases)], seed + number // len(cases))
    except CalibrationError:
        return {}
    return {
        figure: (off.tolist(), [None if np.isnan(one) else float(one) for one in u])
        for figure, (off, u) in found.items()
    }


def drawn_figures(case: Case, seed: int) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Found less true values of one machine [mm, µm/kN], and their stated standard uncertainties, NaN for none, by figure."""
    with tempfile.TemporaryDirectory() as folder:
        plan = table_ii_plan(seed)
        truth = record(
            Path(folder) / "session",
            seed=seed,
            plan=elevated(plan, RAISED_DEG, RAISED) if case.raised else plan,
            mechanisms=[
                RandomKinematics(TOLERANCE_MM, TOLERANCE_MM),
                *([Gravity(1e-6 * COMPLIANCE_UM_KN)] if case.gravity else []),
            ],
            noise=NOISES[seed % len(NOISES)],
            rate_hz=RATE_HZ,
        )
        recorded = load_sessions([Path(folder) / "session"])
        machine = replace(recorded.machine, joint_tolerance_mm=TOLERANCE_MM if case.tolerance else None)
        names = (*KINEMATIC_SOURCES, *(["gravity"] if case.gravity else []), *MEASUREMENT_SOURCES)
        calibration = calibrate(machine, recorded.observations, sources_named(names))
        # As people have it: the model from its file.
        write_model(Path(folder) / "model.yaml", identified_model(calibration, {}, {}))
        identified = read_model(Path(folder) / "model.yaml", known_sources())
    return _parameters(identified, truth, case) | _positions(identified, truth, seed)


def _parameters(
    identified: IdentifiedModel, truth: Truth, case: Case
) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    u = identified.uncertainties
    found, stated = {}, {}
    for fitted in identified.model.of_the_machine().sources:
        name = fitted.source.name
        parameters = fitted.source.parameters(identified.model.machine)
        known = [u[name, "", parameter.name] for parameter in parameters]
        found[name] = fitted.values
        stated[name] = np.array([np.nan if one is None else one for one in known])
    joints = (found["base-joints"].reshape(6, 3) - truth.delta_base_mm, stated["base-joints"].reshape(6, 3))
    figures = {
        "strut lengths": (found["strut-reference-length"] - truth.delta_length_mm, stated["strut-reference-length"]),
        **{f"base joints {axis}": (joints[0][:, k], joints[1][:, k]) for k, axis in enumerate("XYZ")},
    }
    if case.gravity:
        figures["compliance"] = (found["gravity"] - COMPLIANCE_UM_KN, stated["gravity"])
    return figures


def _positions(
    identified: IdentifiedModel, truth: Truth, seed: int
) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    rng = np.random.default_rng([seed, 11])
    poses = rng.uniform(-1.0, 1.0, (POSES, 6)) * [*[REACH_MM] * 3, REACH_DEG, REACH_DEG, 0.0]
    poses[:, 2] += MIDDLE_MM
    actual, u_mm = predicted_poses(identified, poses)
    off_mm = (actual - truth.actual_pose(poses))[:, :3]
    return {f"predicted {axis}": (off_mm[:, k], u_mm[:, k]) for k, axis in enumerate("XYZ")}
