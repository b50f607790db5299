"""Options that say what a session notes beside its runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.number_types import Finite
from dbbstation.cli.shop import from_settings, shop_option

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

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
    help="A calibration of the bar that is older is refused [h]  [default: 24].",
)


def noted_options(function: _Function) -> _Function:
    """Give a command the options of what a session notes; it takes them as keywords and passes them to `session_details`."""
    for option in reversed((*_OPTIONS, *_OF_BAR)):
        function = option(function)
    return function


def session_options(function: _Function) -> _Function:
    """Give a command the same for a session that is measured now: a bar whose calibration is too old is refused."""
    return noted_options(_AGE(function))


def session_details(
    *,
    operator: str,
    job: str,
    serial_number: str,
    ambient_temp_c: float | None,
    bar_serial_number: str,
    bar_length_mm: float | None,
    bar_uncertainty_um: float | None,
    bar_temp_c: float | None,
    bar_file: Path | None,
    bar_waiver: str,
    stroke_mm: float | None,
) -> SessionDetails:
    """Return what was told of machine, shop and bar, with the stroke that the instrument file states [mm].

    Raises:
        click.UsageError: length without uncertainty, something of the bar without either, or a file and options of the bar.
        InputError: faults of the bar's file.
    """
    from dbbstation.files.recordings.session_details import SessionDetails

    if bar_file is not None:
        from dbbstation.files.formats.bar import read_bar

        names = ("bar_serial_number", "bar_length_mm", "bar_uncertainty_um", "bar_temp_c")
        values = (bar_serial_number, bar_length_mm, bar_uncertainty_um, bar_temp_c)
        if any(value not in {"", None} and not from_settings(name) for name, value in zip(names, values, strict=True)):
            raise click.UsageError("--bar says everything of the bar: leave out --bar-length-mm and the like")
        details = SessionDetails(serial_number, operator, ambient_temp_c, read_bar(bar_file).to_bar(stroke_mm))
        return replace(details, bar_waiver=bar_waiver.strip(), job=job.strip())
    bar = _bar(bar_serial_number, bar_length_mm, bar_uncertainty_um, bar_temp_c, stroke_mm)
    return SessionDetails(serial_number, operator, ambient_temp_c, bar, bar_waiver.strip(), job=job.strip())


def stated_length_mm(told: Mapping[str, Any]) -> float | None:
    """Return the length of the bar that its file or `--bar-length-mm` states [mm]; None where neither does.

    Args:
        told: the options, as `session_details` takes them.

    Raises:
        InputError: faults of the bar's file.
    """
    if told["bar_file"] is None:
        length_mm: float | None = told["bar_length_mm"]
        return length_mm
    from dbbstation.files.formats.bar import read_bar

    return read_bar(told["bar_file"]).length_mm


def require_bar(job: Job, largest_age_h: float | None) -> None:
    """Refuse to begin a session whose plan needs the bar's length where nobody has read it lately, unless it is said why.

    A session that goes on has its bar already.

    Args:
        job: what is to be measured.
        largest_age_h: age of a calibration beyond which it is stale [h]; None: the usual one.

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


def _bar(
    serial_number: str,
    length_mm: float | None,
    uncertainty_um: float | None,
    temp_c: float | None,
    stroke_mm: float | None,
) -> Bar | None:
    from dbbstation.plan.bar import Bar

    if length_mm is None and uncertainty_um is None:
        if serial_number or temp_c is not None:
            raise click.UsageError("a bar needs --bar-length-mm and --bar-uncertainty-um")
        return None
    if length_mm is None or uncertainty_um is None:
        raise click.UsageError("--bar-length-mm and --bar-uncertainty-um belong together")
    return Bar(serial_number, length_mm, uncertainty_um / 1e3, None, temp_c, None, stroke_mm)
