"""Every figure of circles, reports, calibrations and predictions that is printed with an uncertainty has a row in the study of coverage."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import dbbstation
from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES
from dbbstation.circles.budget import OF_BOTH, OF_ONE, RANGES
from dbbstation.circles.estimates import BudgetQuantity
from dbbstation.circles.quick_look import Signature
from dbbstation.plan.tolerance import CircleFigure
from studies import coverage_calibration, coverage_feed
from studies.coverage_circles import CELLS, GAUSSIAN, SHARP, _drawn

MODULES = (
    *(f"results/{name}" for name in ("circles", "report", "prediction", "calibration")),
    "diagnosis/effects",
    *(f"circles/{name}" for name in ("reversals", "budget", "quick_look")),
    *(
        f"calibration/{name}"
        for name in ("outliers/outlier", "checks/scatter", "checks/visibility", "reporting/figures")
    ),
)
"""What the tables and the JSON of `circles`, `report`, `calibrate`, `predict` and `evaluate` are made of."""

UNCERTAIN = re.compile(r"(^|_)(u|below|sigma)(_|$)|uncertaint|interval")
"""Names of fields that say how well another one is known."""

CENTRE = {BudgetQuantity.X: "centre", BudgetQuantity.Y: "centre"}
FILTERED = [*RANGES, BudgetQuantity.G_BOTH, BudgetQuantity.G_BOTH_LS, BudgetQuantity.H]
BUDGETED = [
    *(CENTRE.get(quantity, str(quantity)) for quantity in (*OF_ONE, *OF_BOTH)),
    *(f"{quantity}, {filtered}" for quantity in FILTERED for filtered in (GAUSSIAN, SHARP)),
]
OF_TOLERANCES = {
    CircleFigure.CIRCULAR_DEVIATION: ["G(LS), 30 UPR", "G(LS)", f"G(LS), {GAUSSIAN}"],
    CircleFigure.CENTRE_DEVIATION: ["centre deviation"],
    CircleFigure.MEAN_RADIAL_ERROR: ["mean radial error"],
    CircleFigure.RADIAL_DEVIATION: ["Fmax", "Fmin"],
    CircleFigure.BIDIRECTIONAL_CIRCULAR_DEVIATION: ["G(b)(LS)"],
    CircleFigure.MEAN_BIDIRECTIONAL_RADIAL_DEVIATION: ["D"],
    CircleFigure.CIRCULAR_HYSTERESIS: ["H"],
}
PREDICTED = ["predicted X", "predicted Y", "predicted Z"]

PRINTED = {
    "reversals.ReversalStep.u_um": ["reversal step", "closure"],
    "circles.ShownFeed.u": [coverage_feed.FIGURE],
    "budget.Budget.u_um": BUDGETED,
    "circles.CircleFiguresResult.uncertainty": BUDGETED,
    "circles.PairFigures.uncertainty": BUDGETED,
    "quick_look.Symptom.u": [str(one) for one in Signature],
    "quick_look.Symptom.below": [f"{Signature.CYCLIC}, not seen: below"],
    "report.MeasuredSize.u_um": [row for rows in OF_TOLERANCES.values() for row in rows],
    "prediction.PredictionResult.greatest_uncertainty_um": PREDICTED,
    "prediction.PredictionResult.greatest_uncertainty_by_axis_um": PREDICTED,
    "prediction.PredictionResult.uncertainty_mm": PREDICTED,
    "calibration.CalibrationResult.centre_u_um": PREDICTED,
    "calibration.EvaluationResult.flatness_u_um": ["flatness"],
    "calibration.EvaluationResult.parallelism_u_um": ["parallelism"],
}
"""Rows of the study by module, class and field."""

NO_FIGURE = {
    **{
        f"budget.SetUpKnowledge.u_{stated}_um": "stated by the session: it goes into budgets"
        for stated in ("bar", "temperature", "ball", "ball_z", "form")
    },
    "quick_look.QuickLook.sigma_um": "noise of a sample, not printed",
    "outlier.Outlier.uncertainty_um": "beside a run that is left out, not beside a figure of the machine",
    "scatter.ScatterCheck.interval_um": "of what balls scatter by: the interval itself is the answer",
    "visibility.WeakDirection.uncertainty": "says how little a direction is seen; no value stands beside it",
    "effects.CauseEffect.g_u_um": "of a cause that was named: the studies of hidden effects count those",
    "effects.CauseEffect.centre_u_um": "as above",
    "effects.CauseEffect.workspace_u_um": "as above",
    "effects.WorkspaceError.uncertainty_rms_um": "of `diagnose`: the rms of the uncertainties that the rows of `predict` count",
    "effects.WorkspaceError.uncertainty_with_shift_rms_um": "as above",
}
"""Why a field has no row."""


def printed():
    folder = Path(dbbstation.__file__).parent
    return {
        f"{module.rpartition('/')[2]}.{kind.name}.{field.target.id}"
        for module in MODULES
        for kind in ast.parse((folder / f"{module}.py").read_text(encoding="utf-8")).body
        if isinstance(kind, ast.ClassDef)
        for field in kind.body
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and UNCERTAIN.search(field.target.id)
        and not field.target.id.endswith("because")
    }


def test_every_field_with_an_uncertainty_has_a_row_or_a_reason():
    assert printed() == set(PRINTED) | set(NO_FIGURE)
    assert set(OF_TOLERANCES) == set(CircleFigure)
    assert {*OF_ONE, *OF_BOTH} == set(BudgetQuantity)


@pytest.mark.slow
def test_the_study_counts_each_of_these_rows():
    rows = {figure for seed in (1, 2, 8) for figure, _ in _drawn(CELLS[0], seed)}
    rows |= {*coverage_calibration.FIGURES, coverage_feed.FIGURE}
    assert {row for wanted in PRINTED.values() for row in wanted} - rows == set()


def test_calibrated_parameters_are_those_that_are_counted():
    """What `calibrate` fits without being asked for more."""
    assert set(KINEMATIC_SOURCES) == {"strut-reference-length", "base-joints"}
    of_machines = ("strut lengths", *(f"base joints {axis}" for axis in "XYZ"))
    assert set(of_machines) <= set(coverage_calibration.FIGURES)
