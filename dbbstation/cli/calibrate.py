"""`dbbstation calibrate`: fit the machine's errors to recorded sessions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.declared import CommandOutput, command, figure
from dbbstation.cli.output import COVERAGE_FACTOR, EXPANDED, echo, echo_each, print_runs, print_table
from dbbstation.facts.digits import decimals_of, to_its_place
from dbbstation.results.words import fit_sentences, outlier_sentence, residual_lines, use_sentence, visibility_sentences
from dbbstation.tasks.calibrate import calibrate as task

if TYPE_CHECKING:
    from dbbstation.calibration.checks.scatter import ScatterCheck
    from dbbstation.calibration.reporting.figures import CurrentsFigures
    from dbbstation.facts.value import Value
    from dbbstation.results.calibration import CalibrationResult


NOT_TOLD = "-"
MA_PER_A = 1e3


def print_currents(currents: CurrentsFigures | None) -> None:
    """Print drives, centre of gravity and notes of motor currents."""
    if currents is None:
        return
    echo(
        f"\nmotor currents, with the platform's weight of {currents.weight_taken_as_known_n:.0f} N taken as known; "
        "±: u, one standard uncertainty"
    )
    titles = ["motor", "N/A", "±", "friction N", "±", "per speed N s/mm", "±", "per load N/kN", "±", "asymmetry N", "±"]
    kinds = ("force_per_current", "coulomb_n", "viscous_ns_mm", "load_share_n_kn", "asymmetry_n")
    rows = []
    for motor in currents.motors:
        noise = [NOT_TOLD if a is None else f"{MA_PER_A * a:.1f}" for a in (motor.residual_a, motor.noise_a)]
        numbers = [text for kind in kinds for text in _with_uncertainty(getattr(motor, kind))]
        rows.append([motor.motor, *numbers, *noise])
    print_table([*titles, "residual mA", "noise mA"], rows)
    if any(motor.torque_per_current is not None for motor in currents.motors):
        torques = ", ".join(_with_uncertainty(motor.torque_per_current)[0] for motor in currents.motors)
        echo(f"torque at the screws per current, 1 to 6: {torques} Nm/A")
    elif any(motor.force_per_current is not None for motor in currents.motors):
        echo("torques are missing, because the machine file has no screw_lead_mm; forces do not need it")
    if currents.centre_of_gravity:
        echo()
        channels = {"circles": "circles alone", "currents": "currents alone", "both": "both"}
        titles = [column for title in channels.values() for column in (title, "±")]
        shifts = [
            [name.removesuffix("_mm"), *(text for channel in channels for text in _with_uncertainty(by[channel]))]
            for name, by in currents.centre_of_gravity.items()
        ]
        echo("centre of gravity, actual minus machine file, platform axes [mm]; ±: u, one standard uncertainty")
        print_table(["", *titles], shifts)
    for note in currents.notes:
        echo(f"note: {note}")


def _with_uncertainty(number: Value | None) -> tuple[str, str]:
    return (NOT_TOLD, NOT_TOLD) if number is None else to_its_place(number.value, number.uncertainty)


IN_A_TABLE_OF_THEIR_OWN = frozenset({"drive-friction"})
"""Sources with one row per motor instead of one per parameter."""

IN_MM = frozenset({"cog-shift"})
"""Sources whose lengths are not errors of the tool."""


def show(result: CalibrationResult) -> None:
    """Print the parameters and the residual of the fit."""
    print_runs(result.runs)
    echo()
    _print_parameters(result)
    echo()
    echo_each((*visibility_sentences(result), *fit_sentences(result)))
    for check in result.scatter:
        _print_scatter(check, missing_physics=result.misfit.missing_physics)
    echo_each(residual_lines(result))
    print_currents(result.motor_currents)
    echo(use_sentence(result))


def _print_parameters(result: CalibrationResult) -> None:
    rows = []
    for source in result.sources:
        if source.name in IN_A_TABLE_OF_THEIR_OWN:
            continue
        for name, parameter in source.parameters.items():
            value, uncertainty, unit = parameter.value, parameter.uncertainty, parameter.unit
            each = 1.0
            if unit == "mm" and source.name not in IN_MM:
                each, unit = 1e3, "µm"
            cells = [f"{each * value:.1f}", "-", "-"]
            if parameter.is_known:
                u, expanded = each * uncertainty, COVERAGE_FACTOR * each * uncertainty
                cells = [f"{number:.{decimals_of(expanded)}f}" for number in (each * value, u, expanded)]
            rows.append([source.name, name.removesuffix("_mm").replace("_", " "), *cells, unit])
    print_table(f"source, parameter, value, u, {EXPANDED}, unit", rows)


SAID_OF_SCATTER = {
    "as-stated": "as stated",
    "less": "less than stated, which is no fault",
    "more": "NOT as stated: another plate or CMM sheet, loose holders, or a wrong convention of tilts in the machine file?",
}
BESIDE_MISSING_PHYSICS = (
    "more than stated: physics that the model lacks is the likelier reason, so run `dbbstation diagnose` before you doubt "
    "plate, CMM sheet or holders"
)


def _print_scatter(check: ScatterCheck, *, missing_physics: bool) -> None:
    stated = f"balls stated to stand within {check.stated_um:.2f} µm per axis"
    if check.fits is None or check.interval_um is None:
        echo(f"{stated}: these tests cannot tell")
        return
    low, high = check.interval_um
    said = SAID_OF_SCATTER[check.finding]
    if missing_physics and check.finding == "more":
        said = BESIDE_MISSING_PHYSICS
    echo(f"{stated} scatter by {check.found_um:.2f} ({low:.2f} to {high:.2f}) µm, {said}")


calibrate = command(
    task,
    show,
    CommandOutput("out", "MODEL.yaml", said="model written to {path}"),
    figure(said="figure written to {path}"),
    remarks=lambda result: map(outlier_sentence, result.outliers),
)
