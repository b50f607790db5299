"""`dbbstation jig`: make the jig file from measurements of a CMM."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click

from dbbstation.cli.declared import Answer, made
from dbbstation.cli.mapping_options import AsWritten
from dbbstation.cli.output import echo, echo_line, print_table, provenance
from dbbstation.computing.grouped import grouped
from dbbstation.errors import InputError
from dbbstation.files.formats.number_language import number_language
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.files.formats.jig import JigFile
    from dbbstation.files.recordings.dmis import Measured
    from dbbstation.plan.repeatability import HolderResult

_Unit = Literal["mm", "µm", "um", "m", "inch", "mil", "µinch"]


@dataclass(frozen=True, kw_only=True)
class SheetOptions(AsWritten):
    """Options of a sheet and its format."""

    sheet: Annotated[Path, Option("sheet of the CMM.", kind="argument", metavar="SHEET")]
    columns: Annotated[
        tuple[str, ...],
        Option(
            o.COLUMNS,
            metavar="NAME=MEANING",
            whole=True,
        ),
    ] = ()
    unit: Annotated[
        _Unit | None, Option("Unit of a table's coordinates  [default: as stated in the sheet, else mm].")
    ] = None

    def read(
        self, coverage: float | None, u_unit: str | None = None, *, of_one_holder: bool = False
    ) -> Sequence[Measured]:
        """Return the rows; arguments as for `read_sheet`."""
        from dbbstation.files.recordings.cmm_sheet import read_sheet

        return read_sheet(
            self.sheet,
            _meanings(self.columns),
            _micro(self.unit),
            coverage,
            u_unit=_micro(u_unit),
            of_one_holder=of_one_holder,
            numbers=number_language(self.decimal, self.separator),
            encoding=self.encoding,
        )


@click.group()
def jig() -> None:
    r"""Make a jig file from the sheet of a coordinate measuring machine; find how well holders repeat.

    \b
    Examples:
      dbbstation jig sheet cmm.csv --jig plate.yaml --u-um 0.8 --out plate-2026.yaml
      dbbstation jig holders mountings.csv --jig plate.yaml --out plate-2026.yaml
    """


@made(group=jig)
def sheet(
    given: SheetOptions,
    *,
    jig: Annotated[Path, Option("Jig file that the new one is made from.")],
    u_unit: Annotated[
        _Unit | None,
        Option(
            "Unit of the uncertainties, such as µm beside mm  [default: as in the sheet, else the coordinates' unit]."
        ),
    ] = None,
    names: Annotated[
        tuple[str, ...],
        Option("Name of a ball in the sheet, and its name in the jig file.", metavar="LABEL=BALL", whole=True),
    ] = (),
    coverage: Annotated[
        float | None,
        Option("Coverage factor of the sheet's uncertainties, 2 for U (k = 2).", least=0.5, most=5.0),
    ] = None,
    u_um: Annotated[
        float | None,
        Option("Standard uncertainty of coordinates, if the sheet lacks it [µm].", least=0.01, most=1000.0),
    ] = None,
    cmm_temp_c: Annotated[
        float | None,
        Option("Temperature of the plate while it was measured [degC].", least=-30.0, most=80.0),
    ] = None,
    out: Annotated[Path, replace(o.OUT, metavar="JIG.yaml")],
    force: o.Force = False,
) -> Answer:
    r"""Write a jig file with the balls of a CMM sheet: a table, or a DMIS file with measured features (.dmo, .dmi, .dmis, .out).

    Columns are found by their names, or named by --columns as ball, bore, holder, x, y, z, u or ux, uy, uz. A sheet with
    one coordinate a row has axis, value and unit. Coordinates are in the jig's frame. Plate and holders come from --jig. A jig file has one uncertainty per ball:
    the root mean square of its three axes. Each ball is shown with its change since the former jig file.

    \b
    Examples:
      dbbstation jig sheet cmm.csv --jig plate.yaml --columns X=x --columns "U (k=2)=u" --coverage 2 --out new.yaml
      dbbstation jig sheet plate.dmo --jig plate.yaml --names SPH1=9-short --u-um 0.8 --cmm-temp-c 20.1 --out new.yaml
    """
    from dbbstation.files.formats.jig import jig_text, read_jig
    from dbbstation.files.provenance import refuse_existing_table, write_table
    from dbbstation.files.recordings.cmm_sheet import jig_of_sheet
    from dbbstation.results.jig import MeasuredBall, SheetResult

    refuse_existing_table(out, force=force)
    old = read_jig(jig)
    new = jig_of_sheet(
        old,
        given.read(coverage, u_unit),
        str(given.sheet),
        names=dict(_pairs(names, "--names", "LABEL=BALL")),
        uncertainty_um=u_um,
        cmm_temp_c=cmm_temp_c,
    )
    write_table(out, jig_text(new), provenance(), force=force)
    balls = {name: _change_um(old, name, ball.centre_mm) for name, ball in new.balls.items()}
    lost = [name for name in old.balls if name not in new.balls]
    told = {name: MeasuredBall(tuple(new.balls[name].centre_mm), change) for name, change in balls.items()}
    rows = [
        [
            name,
            *(f"{value:.4f}" for value in new.balls[name].centre_mm),
            f"{new.balls[name].uncertainty_um:.2f}",
            *(["new", "", ""] if change is None else [f"{value:+.1f}" for value in change]),
        ]
        for name, change in balls.items()
    ]

    def words() -> None:
        print_table("ball, x [mm], y [mm], z [mm], u [µm], dx [µm], dy [µm], dz [µm]", rows)
        if lost:
            echo(f"balls that the sheet lacks, left out of the new file: {', '.join(lost)}")
        if cmm_temp_c is None:
            echo("the file lacks the plate's temperature on the CMM: give --cmm-temp-c")
        echo_line(f"{len(balls)} balls written to {out}")

    return Answer(SheetResult(str(out), told, tuple(lost)), words)


@made(group=jig)
def holders(
    given: SheetOptions,
    *,
    holder: Annotated[str | None, Option("Holder of all rows, if the table does not state it.")] = None,
    cmm_repeatability_um: Annotated[
        float,
        Option(
            "Standard deviation of CMM readings of an untouched ball; its variance is subtracted.",
            least=0.0,
            most=100.0,
        ),
    ] = 0.0,
    jig: Annotated[Path | None, Option("Jig file that the new one is made from.")] = None,
    out: Annotated[Path | None, replace(o.OUT, metavar="JIG.yaml")] = None,
    force: o.Force = False,
) -> Answer:
    r"""Compute how well holders reproduce the ball's position, from repeated mountings [CAL III-B].

    The table has one row per mounting, with holder, bore (or ball) and x, y, z. Ten mountings in each place are usual.
    The scatter is computed about the mean of each place. The standard deviation per axis is the jig file's
    `repeatability_um`; its chi-square interval is printed too.

    \b
    Examples:
      dbbstation jig holders mountings.csv
      dbbstation jig holders mountings.csv --cmm-repeatability-um 0.3 --jig plate.yaml --out plate-2026.yaml
    """
    from dbbstation.files.provenance import refuse_existing_table
    from dbbstation.plan.repeatability import repeatability
    from dbbstation.results.jig import HoldersResult

    if (jig is None) != (out is None):
        raise click.UsageError(
            "give --jig and --out together: the new file is the old file with the computed repeatability"
        )
    if out is not None:
        refuse_existing_table(out, force=force)
    rows = given.read(1.0, of_one_holder=True)
    found: dict[str, HolderResult] = {}
    try:
        for name, places in _by_holder(rows, holder, given.sheet).items():
            found[name] = repeatability(places, cmm_repeatability_um)
    except ValueError as error:
        raise InputError.of(given.sheet, str(error), "put each ball up at least twice, ten times is usual") from error
    if jig is not None and out is not None:
        _write_holders(found, jig, out, given.sheet, force=force)

    def words() -> None:
        _print_holders(found)
        if out is not None:
            echo_line(f"holders written to {out}")

    return Answer(HoldersResult(found, None if out is None else str(out)), words)


def _write_holders(found: Mapping[str, HolderResult], jig: Path, out: Path, sheet: Path, *, force: bool) -> None:
    from dbbstation.files.formats.jig import HolderSchema, checked_jig, jig_text, read_jig
    from dbbstation.files.provenance import write_table

    old = read_jig(jig)
    unknown = [name for name in found if name not in old.holders]
    if unknown:
        what = f"the jig has no holder {', '.join(unknown)}"
        raise InputError.of(jig, what, f"its holders: {', '.join(old.holders)}")
    scatter = {name: float(f"{one.together.s_um:.4g}") for name, one in found.items()}
    holders = {name: HolderSchema.model_construct(repeatability_um=s_um) for name, s_um in scatter.items()}
    new = checked_jig(jig_text(old.model_copy(update={"holders": {**old.holders, **holders}})), str(sheet))
    write_table(out, jig_text(new), provenance(), force=force)


def _print_holders(found: Mapping[str, HolderResult]) -> None:
    from dbbstation.plan.repeatability import UNLIKE_AXES

    lines: list[list[object]] = []
    for name, one in found.items():
        axes = ", ".join(f"{scatter.s_um:.2f}" for scatter in one.axes.values())
        interval = f"{one.together.low_um:.2f} to {one.together.high_um:.2f}"
        distance = f"{one.rms_distance_um:.2f}"
        lines.append([name, one.places, one.mountings, axes, f"{one.together.s_um:.2f}", interval, distance])
    titles = ["holder", "places", "mountings", "s of x, y, z [µm]", "s per axis [µm]", "95 %", "rms distance [µm]"]
    print_table(titles, lines)
    for name, one in found.items():
        if one.p_axes_alike < UNLIKE_AXES:
            echo(f"{name}: the axes scatter differently (p = {one.p_axes_alike:.2g}); a jig file has one value for all")


def _micro(unit: str | None) -> str | None:
    return None if unit is None else unit.replace("um", "µm")


_WHAT = ("ball", "bore", "holder", "x", "y", "z", "u", "ux", "uy", "uz", "axis", "value", "unit")


def _meanings(texts: Sequence[str]) -> dict[str, str]:
    found = {what: name for name, what in _pairs(texts, "--columns", "NAME=MEANING")}
    if unknown := [what for what in found if what not in _WHAT]:
        raise click.UsageError(f"--columns: {', '.join(unknown)} is no meaning; meanings are {', '.join(_WHAT)}")
    return found


def _pairs(texts: Sequence[str], option: str, form: str) -> list[tuple[str, str]]:
    found = [(text.rpartition("=")[0], text.rpartition("=")[2]) for text in texts]
    for text, (first, second) in zip(texts, found, strict=True):
        if not (first and second):
            raise click.UsageError(f"{option} {text}: write {form}")
    return found


def _change_um(old: JigFile, name: str, centre_mm: Sequence[float]) -> tuple[float, ...] | None:
    if name not in old.balls:
        return None
    return tuple(1e3 * (new - before) for new, before in zip(centre_mm, old.balls[name].centre_mm, strict=True))


def _by_holder(rows: Sequence[Any], holder: str | None, sheet: Path) -> dict[str, list[Any]]:
    """Return centres by holder and place, shape (n, axes) each [µm]."""
    import numpy as np

    groups: dict[tuple[str, object], list[tuple[float, ...]]] = {}
    for row in rows:
        name = row.holder or holder
        if not name:
            what = "nothing says which holder this row is of"
            raise InputError.of(
                sheet, what, "state it with --columns NAME=holder, or --holder for all rows", line=row.line
            )
        centre = tuple(1e3 * value for value in row.centre_mm if np.isfinite(value))
        groups.setdefault((name, row.name or row.bore), []).append(centre)
    return grouped((name, np.array(centres)) for (name, _), centres in groups.items())
