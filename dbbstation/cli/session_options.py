"""Options on what a session notes beside its runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.number_types import Finite
from dbbstation.cli.shop import from_settings, shop_option

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.files.recordings.session_details import SessionDetails
    from dbbstation.plan.bar import Bar
    from dbbstation.station.assembly import Job

_Function = TypeVar("_Function", bound="Callable[..., Any]")

_OPTIONS = (
    click.option("--operator", default="", help="Name of the operator."),
    click.option("--job", default="", help="Job or order number: what it is measured for."),
    shop_option("--serial-number", setting="serial_number", default="", help="Serial number of the machine."),
    click.option("--ambient-temp-c", type=Finite(), help="Temperature of the shop [degC]."),
    shop_option("--bar-serial-number", setting="bar.serial_number", default="", help="Serial number of the bar."),
    shop_option(
        "--bar-length-mm",
        setting="bar.calibrated_length_mm",
        type=Finite(),
        help="Calibrated distance between the ball centres [mm]; held against the plan's radii, never added to readings.",
    ),
    shop_option(
        "--bar-uncertainty-um",
        setting="bar.calibrator_uncertainty_mm",
        factor=1e3,
        type=Finite(),
        help="Standard uncertainty u of that length [µm].",
    ),
    shop_option(
        "--bar-temp-c", setting="bar.temp_c", type=Finite(), help="Temperature of the bar at its calibration [degC]."
    ),
)


_OF_BAR = (
    click.option(
        "--bar", "bar_file", type=click.Path(path_type=Path), help="Calibration of the bar, from `dbbstation bar`."
    ),
    click.option("--bar-waiver", default="", help="Why it is measured without a fresh calibration of the bar."),
)

_AGE = shop_option(
    "--largest-bar-age-h",
    setting="limits.largest_bar_age_h",
    type=Finite(0.1, 10_000),
    help="Older calibrations of the bar are refused [h]  [default: 24].",
)


def noted_options(function: _Function) -> _Function:
    """Give a command these options as keywords of `SessionOptions`."""
    for option in reversed((*_OPTIONS, *_OF_BAR)):
        function = option(function)
    return function


def session_options(function: _Function) -> _Function:
    """Give a command the same, with a limit for the bar's age."""
    return noted_options(_AGE(function))


@dataclass(frozen=True)
class SessionOptions:
    """Stated facts of machine, shop and bar.

    Attributes:
        bar_temp_c: at calibration; None if unknown.
        bar_file: instead of these; None for none.
        bar_waiver: reason for no fresh calibration; may be empty.
    """

    operator: str
    job: str
    serial_number: str
    ambient_temp_c: float | None
    bar_serial_number: str
    bar_length_mm: float | None
    bar_uncertainty_um: float | None
    bar_temp_c: float | None
    bar_file: Path | None
    bar_waiver: str

    def details(self, stroke_mm: float | None = None) -> SessionDetails:
        """Return what a session notes.

        Raises:
            click.UsageError: a blank name, length without uncertainty, something of the bar without either, or a file and options of the bar.
            InputError: faults of the bar's file.
        """
        from dbbstation.files.recordings.session_details import SessionDetails

        for name in ("operator", "job", "serial_number"):
            if (text := getattr(self, name)) and not text.strip():
                option = name.replace("_", "-")
                raise click.UsageError(f"--{option} is blank: state it, or leave --{option} out")
        if self.bar_file is None:
            bar = self._bar(stroke_mm)
        else:
            from dbbstation.files.formats.bar import read_bar

            if self.of_bar:
                raise click.UsageError("--bar says everything of the bar: leave out --bar-length-mm and the like")
            bar = read_bar(self.bar_file).to_bar(stroke_mm)
        return SessionDetails(
            self.serial_number.strip(),
            self.operator.strip(),
            self.ambient_temp_c,
            bar,
            self.bar_waiver.strip(),
            job=self.job.strip(),
        )

    @property
    def of_bar(self) -> list[str]:
        """Return given options of the bar beside its file, without settings."""
        given = {
            "bar_serial_number": self.bar_serial_number,
            "bar_length_mm": self.bar_length_mm,
            "bar_uncertainty_um": self.bar_uncertainty_um,
            "bar_temp_c": self.bar_temp_c,
        }
        return [name for name, value in given.items() if value not in {"", None} and not from_settings(name)]

    def stated_length_mm(self) -> float | None:
        """Return the length by file or `--bar-length-mm` [mm], or None.

        Raises:
            InputError: faults of the bar's file.
        """
        if self.bar_file is None:
            return self.bar_length_mm
        from dbbstation.files.formats.bar import read_bar

        return read_bar(self.bar_file).length_mm

    def _bar(self, stroke_mm: float | None) -> Bar | None:
        from dbbstation.plan.bar import Bar

        length_mm, u_um = self.bar_length_mm, self.bar_uncertainty_um
        if length_mm is None and u_um is None:
            if self.bar_serial_number or self.bar_temp_c is not None:
                raise click.UsageError("a bar needs --bar-length-mm and --bar-uncertainty-um")
            return None
        if length_mm is None or u_um is None:
            raise click.UsageError("--bar-length-mm and --bar-uncertainty-um belong together")
        return Bar(self.bar_serial_number, length_mm, u_um / 1e3, None, self.bar_temp_c, None, stroke_mm)


def require_bar(job: Job, largest_age_h: float | None) -> None:
    """Refuse a new session whose plan needs the bar's length without fresh calibration or reason.

    Raises:
        InputError: what is wrong with the bar, and what to do.
    """
    from datetime import UTC, datetime

    from dbbstation.files.recordings.session import SESSION_FILE
    from dbbstation.station.bar_known import USUAL_AGE_H, check_bar_known

    if job.details.bar_waiver or (job.folder / SESSION_FILE).is_file():
        return
    largest = USUAL_AGE_H if largest_age_h is None else largest_age_h
    check_bar_known(job.details.bar, job.plan.to_domain(), datetime.now(UTC), largest)
