"""Coverage of parameters and predictions with sessions of tests/plant, an independent machine."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from ruamel.yaml import YAML

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES, MEASUREMENT_SOURCES, calibrate
from dbbstation.calibration.reporting.evaluation import plane_figures, plane_uncertainty_um
from dbbstation.calibration.reporting.figures import identified_model
from dbbstation.errors import CalibrationError
from dbbstation.files.formats.model import read_model, write_model
from dbbstation.model.identified import predicted_poses
from dbbstation.plan.bar import EXPANSION_UNCERTAINTY
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.tasks.load import load_sessions
from studies.coverage_rows import row_of
from studies.kept_draws import drawn
from tests.plant.mechanisms.balls import CmmScatter, MountingScatter
from tests.plant.mechanisms.bar import BarOffset, RandomBarOffset
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
    from tests.plant.mechanisms.base import Mechanism
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
BAR_MM = 150.0
LOWEST_MM = -1150.0
"""Height of the lowest circles, at which flatness and parallelism are predicted."""
ALONG = 39
"""Points along X at which parallelism is taken."""
COMPLIANCE_UM_KN = 9.68

OF_A_FORMULA = "u holds the 2 % by which real struts depart from the formula; the generator's follow it exactly"


class KnownBar(Enum):
    """What a session states of its bar; errors are drawn accordingly."""

    CALIBRATED = "calibrated where it measures"
    WARM = "calibrated at 20 degC, shop at 28 degC"
    NOBODY_KNOWS = "no word of it"


WARM_DEGC = 28.0
EXPANSION_UM_M_K = 11.5
TEMPERATURE_U_K = 0.3
UNKNOWN_BAR_UM = 50.0
"""Standard deviation of the length of bars that nobody put on a calibrator."""


@dataclass(frozen=True)
class Case:
    """Circumstances of a calibration.

    Attributes:
        raised: five raised bars, which show the base's height.
        tolerance: the machine file states joints' tolerance.
        gravity: elastic struts with fitted compliance.
    """

    name: str
    raised: bool
    tolerance: bool
    gravity: bool = False
    bar: KnownBar = KnownBar.CALIBRATED


CASES = (
    Case("level bars, tolerance unknown", raised=False, tolerance=False),
    Case("level bars, tolerance known", raised=False, tolerance=True),
    Case("raised bars, tolerance unknown", raised=True, tolerance=False),
    Case("raised bars, tolerance known", raised=True, tolerance=True),
    Case("raised bars, gravity fitted", raised=True, tolerance=False, gravity=True),
)
OF_BARS = (
    Case("raised bars, bar not known", raised=True, tolerance=False, bar=KnownBar.NOBODY_KNOWS),
    Case("level bars, bar not known", raised=False, tolerance=False, bar=KnownBar.NOBODY_KNOWS),
    Case("raised bars, bar warmer by 8 K", raised=True, tolerance=False, bar=KnownBar.WARM),
)
"""Circumstances of calibrations with bars that are not as long as stated where they measure."""

Figures = dict[str, tuple[list[float], list[float | None]]]
"""Found less true values of one draw and their stated standard uncertainties, by figure; None where none is stated."""

FIGURES = (
    "strut lengths",
    "base joints X",
    "base joints Y",
    "base joints Z",
    "compliance",
    *(f"predicted {a}" for a in "XYZ"),
    "flatness",
    "parallelism",
)


def coverage_of_calibration(
    cases: Sequence[Case],
    seeds: range,
    progress: Callable[[int], None] = lambda _done: None,
    keep: Path | None = None,
) -> list[Row]:
    """Draw machines, record, calibrate, predict, compare.

    Args:
        cases: each sees all machines.
        keep: file of draws, or None.
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
    """Return one draw by number, cases in turn; empty if the fit does not settle."""
    try:
        found = drawn_figures(cases[number % len(cases)], seed + number // len(cases))
    except CalibrationError:
        return {}
    return {
        figure: (off.tolist(), [None if np.isnan(one) else float(one) for one in u])
        for figure, (off, u) in found.items()
    }


def drawn_figures(case: Case, seed: int) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return found less true values [mm, µm/kN] and standard uncertainties, NaN for none, by figure."""
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
            setup=_setup(case.bar, seed),
            noise=NOISES[seed % len(NOISES)],
            rate_hz=RATE_HZ,
        )
        _state(Path(folder) / "session" / "session.yaml", case.bar)
        recorded = load_sessions([Path(folder) / "session"])
        machine = replace(recorded.machine, joint_tolerance_mm=TOLERANCE_MM if case.tolerance else None)
        names = (*KINEMATIC_SOURCES, *(["gravity"] if case.gravity else []), *MEASUREMENT_SOURCES)
        calibration = calibrate(machine, recorded.observations, sources_named(names))
        # As people have it: the model from its file.
        write_model(Path(folder) / "model.yaml", identified_model(calibration, {}, {}))
        identified = read_model(Path(folder) / "model.yaml", known_sources())
    return _parameters(identified, truth, case) | _positions(identified, truth, seed) | _plane(identified, truth)


def _setup(known: KnownBar, seed: int) -> tuple[Mechanism, ...]:
    """Return errors of balls and bar, with the bar's growth."""
    balls = (MountingScatter(), CmmScatter())
    if known is KnownBar.NOBODY_KNOWS:
        return (*balls, RandomBarOffset(UNKNOWN_BAR_UM))
    if known is KnownBar.CALIBRATED:
        return (*balls, RandomBarOffset())
    rng = np.random.default_rng([seed, 13])
    warmer_k = WARM_DEGC - 20.0 + TEMPERATURE_U_K * (rng.standard_normal() - rng.standard_normal())
    um_per_k = 1e-3 * EXPANSION_UM_M_K * (1.0 + EXPANSION_UNCERTAINTY * rng.standard_normal()) * BAR_MM
    return (*balls, RandomBarOffset(), BarOffset(-um_per_k * warmer_k))


def _state(session: Path, known: KnownBar) -> None:
    if known is KnownBar.CALIBRATED:
        return
    yaml = YAML(pure=True)  # that keeps all else as it was written
    content = yaml.load(session)
    if known is KnownBar.NOBODY_KNOWS:
        del content["bar"]
    else:
        content["ambient_temp_c"] = WARM_DEGC
        content["bar"].update({"temp_c": 20.0, "expansion_um_m_k": EXPANSION_UM_M_K})
    yaml.dump(content, session)


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


def _plane(identified: IdentifiedModel, truth: Truth) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return predicted flatness and parallelism, and the generator's."""
    steps = np.linspace(-190.0, 190.0, 3)
    ring = [(x, y) for x in steps for y in steps if (x, y) != (0.0, 0.0)]
    found = plane_figures(identified.model, LOWEST_MM)
    u_um = plane_uncertainty_um(identified, LOWEST_MM)
    figures = {}
    for k, (figure, points, axis, value_um) in enumerate(
        (
            ("flatness", ring, 2, found.flatness_um),
            ("parallelism", [(x, 0.0) for x in np.linspace(-190.0, 190.0, ALONG)], 1, found.parallelism_um),
        )
    ):
        poses = np.array([[x, y, LOWEST_MM, 0.0, 0.0, 0.0] for x, y in points])
        true_um = 1e3 * float(np.ptp((truth.actual_pose(poses) - poses)[:, axis]))
        u = u_um[k]
        figures[figure] = (np.array([1e-3 * (value_um - true_um)]), np.array([np.nan if u is None else 1e-3 * u]))
    return figures
