"""The tables of motor currents."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import echo, print_table
from dbbstation.text.digits import to_its_place

if TYPE_CHECKING:
    from dbbstation.calibration.reporting.motors import CurrentsFigures
    from dbbstation.facts.value import Value

NOT_TOLD = "-"
MA_PER_A = 1e3


def print_currents(currents: CurrentsFigures | None) -> None:
    """Print drives, centre of gravity by channel and notes of motor currents."""
    if currents is None:
        return
    echo()
    echo(
        f"motor currents, with the platform's weight of {currents.weight_taken_as_known_n:.0f} N taken as known; "
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
        echo("torques are not given: the machine file has no screw_lead_mm; forces do not need it")
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
