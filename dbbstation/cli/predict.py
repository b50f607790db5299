"""`dbbstation predict` and `simulate`: poses and recordings as a model predicts them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.declared import CommandOutput, command
from dbbstation.cli.output import COVERAGE_FACTOR, EXPANDED, say
from dbbstation.tasks.predict import predict as predict_task
from dbbstation.tasks.simulate import simulate as simulate_task

if TYPE_CHECKING:
    from dbbstation.results.prediction import PredictionResult
    from dbbstation.results.sessions import SimulatedSession


def show(result: PredictionResult) -> None:
    """Print the errors of the poses, with their uncertainties."""
    say(f"{result.poses} poses written to {result.file}")
    shift = ", ".join(f"{axis} {um:+.1f}" for axis, um in zip("XYZ", result.common_shift_um, strict=True))
    say(
        f"position errors {result.error_rms_um:.1f} µm rms, {result.greatest_error_um:.1f} µm at most; their mean is {shift} µm, "
        f"and they are {result.error_about_mean_rms_um:.1f} µm rms about it"
    )
    u_um = result.greatest_uncertainty_um
    if u_um is not None:
        say(f"greatest uncertainty u {u_um:.1f} µm, {EXPANDED} {COVERAGE_FACTOR * u_um:.1f} µm")
        return
    by_axis = result.greatest_uncertainty_by_axis_um
    known = [f"{axis.upper()} {u:.1f}" for axis, u in by_axis.items() if u is not None]
    unknown = [axis.upper() for axis, u in by_axis.items() if u is None]
    say(
        f"{'greatest uncertainty u ' + ', '.join(known) + ' µm; ' if known else ''}"
        f"u of {', '.join(unknown)} is not known: {result.uncertainty_not_known_because}"
    )
    if result.directions_lost:
        say(
            "  a joint_tolerance_mm in the machine file of the calibration, or tests that measure it, would determine it"
        )


predict = command(predict_task, show, CommandOutput("table", table=True, field="file", required=True))


def show_simulated(result: SimulatedSession) -> None:
    """Print what was written."""
    say(f"{result.runs} runs written to {result.session}")


simulate = command(
    simulate_task, show_simulated, CommandOutput("out", "SESSION", folder=True, required=True, field="session")
)
