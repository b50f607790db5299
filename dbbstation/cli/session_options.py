"""Options for facts that a session notes in addition to its runs."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import click

from dbbstation.cli.instrument_options import PROGRAMS, Spy
from dbbstation.cli.shop import from_settings
from dbbstation.files.places import SESSION_FILE
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from dbbstation.files.formats.plan import PlanFile
    from dbbstation.files.formats.session import SessionDetails
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.plan.bar import Bar
    from dbbstation.station.assembly import Job


@dataclass(frozen=True, kw_only=True)
class SessionOptions:
    """Options for facts of machine, shop and bar."""

    operator: Annotated[str, Option("Name of the operator.")] = ""
    job: Annotated[str, Option("Job or order number of the measurement.")] = ""
    serial_number: Annotated[str, Option("Serial number of the machine.", setting="serial_number")] = ""
    ambient_temp_c: Annotated[float | None, Option("Temperature of the shop [degC].")] = None
    bar_serial_number: Annotated[str, Option("Serial number of the bar.", setting="bar.serial_number")] = ""
    bar_length_mm: Annotated[
        float | None,
        Option(
            "Calibrated distance between the ball centres [mm], compared with the plan's radii, never added to readings.",
            setting="bar.calibrated_length_mm",
        ),
    ] = None
    bar_uncertainty_um: Annotated[
        float | None,
        Option("Standard uncertainty u of the bar's length [µm].", setting="bar.calibrator_uncertainty_mm", factor=1e3),
    ] = None
    bar_temp_c: Annotated[
        float | None, Option("Temperature of the bar at its calibration [degC].", setting="bar.temp_c")
    ] = None
    bar: Annotated[Path | None, Option("File with the bar's calibration, written by `dbbstation bar`.")] = None
    bar_waiver: Annotated[str, Option("Reason for measuring without a fresh calibration of the bar.")] = ""

    def details(self, stroke_mm: float | None = None) -> SessionDetails:
        """Return the facts that a session notes.

        Raises:
            click.UsageError: a blank name, incomplete facts of the bar, or options in addition to its file.
            InputError: faults of the bar's file.
        """
        from dbbstation.files.formats.session import SessionDetails

        for name in ("operator", "job", "serial_number"):
            if (text := getattr(self, name)) and not text.strip():
                option = name.replace("_", "-")
                raise click.UsageError(f"--{option} is blank: state it, or leave --{option} out")
        if self.bar is None:
            bar = self._stated_bar(stroke_mm)
        else:
            from dbbstation.files.formats.bar import read_bar

            if self.of_bar:
                raise click.UsageError("--bar has all facts of the bar: leave out --bar-length-mm and similar options")
            bar = read_bar(self.bar).to_bar(stroke_mm)
        return SessionDetails(
            serial_number=self.serial_number.strip(),
            operator=self.operator.strip(),
            ambient_temp_c=self.ambient_temp_c,
            bar=bar,
            bar_waiver=self.bar_waiver.strip(),
            job=self.job.strip(),
        )

    @property
    def of_bar(self) -> list[str]:
        """Return options of the bar given in addition to its file, without settings."""
        names = ("bar_serial_number", "bar_length_mm", "bar_uncertainty_um", "bar_temp_c")
        return [name for name in names if getattr(self, name) not in {"", None} and not from_settings(name)]

    def stated_length_mm(self) -> float | None:
        """Return the bar's length from its file or `--bar-length-mm` [mm], or None.

        Raises:
            InputError: faults of the bar's file.
        """
        if self.bar is None:
            return self.bar_length_mm
        from dbbstation.files.formats.bar import read_bar

        return read_bar(self.bar).length_mm

    def _stated_bar(self, stroke_mm: float | None) -> Bar | None:
        from dbbstation.plan.bar import Bar

        length_mm, u_um = self.bar_length_mm, self.bar_uncertainty_um
        if length_mm is None and u_um is None:
            if self.bar_serial_number or self.bar_temp_c is not None:
                raise click.UsageError("a bar needs --bar-length-mm and --bar-uncertainty-um")
            return None
        if length_mm is None or u_um is None:
            raise click.UsageError("--bar-length-mm and --bar-uncertainty-um belong together")
        return Bar(self.bar_serial_number, length_mm, u_um / 1e3, None, self.bar_temp_c, None, stroke_mm)


@dataclass(frozen=True, kw_only=True)
class RecordingOptions(SessionOptions):
    """`SessionOptions` and options for recording runs."""

    spy: Spy = None
    largest_loss_percent: Annotated[
        float | None,
        Option(
            "Largest share of lost samples [%]; a run that lost more is repeated  [default: the plan's, else 0.5].",
            setting="limits.largest_loss_percent",
            least=0.0,
            most=100.0,
        ),
    ] = None
    model: Annotated[
        Path | None,
        o.MODEL,
    ] = None
    source_files: o.SourcePaths = ()
    # The values of `Order` and `Gate`; a test holds them together, so that no command waits for what those import.
    order: Annotated[
        Literal["plan", "holder", "drift"],
        Option(
            "Order of tests: as in the plan; by holder, so that each ball is put up once; or with mixed heights, so that drift does not look like an effect of height."
        ),
    ] = "plan"
    gate: Annotated[
        Literal["plan", "first", "holders"],
        Option(
            "Test that is repeated at the end to show drift, if the plan names none: the first test, or the first test of each holder."
        ),
    ] = "plan"
    programs: Annotated[Path | None, PROGRAMS] = None
    largest_bar_age_h: Annotated[
        float | None,
        Option(
            "Largest age of the bar's calibration [h]  [default: 24].",
            setting="limits.largest_bar_age_h",
            least=0.1,
            most=10_000.0,
        ),
    ] = None

    def in_force(self, plan: PlanFile) -> PlanFile:
        """Return the plan with the chosen order and limit of lost samples.

        The command line overrides the plan, which overrides the shop's settings.
        """
        from dbbstation.service.choice import Gate, Order, ordered, with_loss

        over_plan = not from_settings("largest_loss_percent")
        plan = with_loss(plan, self.largest_loss_percent, over_plan=over_plan)
        return ordered(plan, Order(self.order), Gate(self.gate))

    def judging_model(self) -> IdentifiedModel | None:
        """Return the model of expected circles, or None.

        Raises:
            InputError: every fault with its place.
        """
        if self.model is None:
            return None
        from dbbstation.files.formats.model import read_model
        from dbbstation.files.own_sources import every_source

        return read_model(self.model, every_source(self.source_files))

    def require_bar(self, job: Job) -> None:
        """Refuse a new session whose plan needs the bar's length, unless a fresh calibration or a reason is given.

        Raises:
            InputError: what is wrong with the bar, and what to do.
        """
        from dbbstation.station.bar_known import USUAL_AGE_H, check_bar_known

        if job.details.bar_waiver or (job.folder / SESSION_FILE).is_file():
            return
        largest = USUAL_AGE_H if self.largest_bar_age_h is None else self.largest_bar_age_h
        check_bar_known(job.details.bar, job.plan.to_domain(), datetime.now(UTC), largest)
