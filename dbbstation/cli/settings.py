"""`dbbstation settings`: the shop's settings with their origin."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import click

from dbbstation.cli.declared import made
from dbbstation.cli.lazy import made_ready
from dbbstation.cli.output import echo, echo_line, print_result, print_table, which_circles
from dbbstation.cli.shop import shop_settings
from dbbstation.files.places import shipped_folder
from dbbstation.nc.limits import CHORD_MM, LARGEST_CORRECTION_MM
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from dbbstation.files.formats.settings import Settings
    from dbbstation.results.settings import SettingsResult


class _WithShipped(click.Command):
    """A command that takes a session or its one subcommand."""

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,  # noqa: ANN401
    ) -> click.Context:
        """Return the subcommand's context if the user names it."""
        if args[:1] == [SHIPPED]:
            from dbbstation.cli.shipped import shipped

            return made_ready(shipped).make_context(f"{info_name} {SHIPPED}", args[1:], parent, **extra)
        return super().make_context(info_name, args, parent, **extra)


SHIPPED = "shipped"


@made(kind=_WithShipped)
def settings(
    folder: Annotated[Path | None, Option("session.", kind="argument", metavar="[SESSION]")] = None,
    *,
    template: Annotated[bool, Option("Print a settings file with every key as a comment, and stop.")] = False,
    as_json: o.Json = False,
) -> None:
    r"""Show the shop's settings: every key, its value, and the file and line that it comes from.

    Commands first read `dbbstation-settings.yaml` in the folder that contains SESSION, or in the working folder if they
    use no session. Then they read `settings.yaml` in the user's configuration folder. For each key, the first file that
    has it applies. `dbbstation --settings FILE` reads that file alone. Options on the command line override settings,
    and each command reports the options that come from settings.

    \b
    Examples:
      dbbstation settings
      dbbstation settings 2026-11-20-hexapod-7
      dbbstation settings --template > dbbstation-settings.yaml
      dbbstation settings 2026-11-20-hexapod-7 --json
      dbbstation settings shipped                         (files of the program; `settings shipped --help`)
    """
    if template:
        if folder is not None or as_json:
            raise click.UsageError("--template prints a settings file and allows no other option")
        echo(_template(), nl=False)
        return
    found = shop_settings()
    if as_json:
        print_result(_result(found))
    else:
        _print(found)


NOT_SET = "not set"
PROGRAM = "dbbstation"


def built_in() -> dict[str, str | int | float | None]:
    """Return the program's own values by key, or None; without tolerances."""
    from dbbstation.files.formats.number_language import PLAIN
    from dbbstation.nc.circle_program import CLEARANCE_MM, STEP_DEG
    from dbbstation.plan.plan import LARGEST_LOSS_PERCENT
    from dbbstation.station.bar_known import USUAL_AGE_H

    return {
        **dict.fromkeys(("instrument", "profile", "port", "baud", "serial_number")),
        **{
            f"bar.{key}": None
            for key in ("serial_number", "calibrated_length_mm", "calibrator_uncertainty_mm", "temp_c")
        },
        "program.dialect": "linuxcnc",
        "program.step_deg": STEP_DEG,
        "program.chord_um": 1e3 * CHORD_MM,
        "program.clearance_mm": CLEARANCE_MM,
        "limits.largest_correction_mm": LARGEST_CORRECTION_MM,
        "limits.largest_loss_percent": LARGEST_LOSS_PERCENT,
        "limits.largest_bar_age_h": USUAL_AGE_H,
        "numbers.decimal": PLAIN.decimal,
        "numbers.separator": PLAIN.separator,
        **dict.fromkeys(("simulators", "report.laboratory", "report.customer", "report.logo")),
    }


def _result(found: Settings) -> SettingsResult:
    from dbbstation.calibration.reporting.evaluation import stated
    from dbbstation.results.settings import SettingsResult, ShopTolerance, ShownSetting
    from dbbstation.results.tolerances import filter_words

    values = {}
    for key, own in built_in().items():
        setting = found.values.get(key)
        if setting is None:
            values[key] = ShownSetting(own, None if own is None else PROGRAM)
        else:
            value = ", ".join(setting.value) if isinstance(setting.value, tuple) else setting.value
            values[key] = ShownSetting(value, setting.origin)
    return SettingsResult(
        files=tuple(str(path) for path in found.files),
        values=values,
        tolerances=tuple(ShopTolerance(**stated(one), filter=filter_words(one)) for one in found.tolerances),
        tolerances_from=found.tolerances_from or None,
    )


def _print(found: Settings) -> None:
    result = _result(found)
    rows = []
    for key, one in result.values.items():
        value = NOT_SET if one.value is None else str(one.value).replace("\t", "tab")
        value = re.sub(r"\b[0-9a-f]{64}\b", lambda hashed: f"{hashed[0][:12]}…", value)
        rows.append([key, value, one.origin])
    print_table("setting, value, from", rows)
    for held in result.tolerances:
        circles = which_circles(held.tests, held.directions)
        filtered = "" if held.filter is None else f" (filter: {held.filter})"
        echo_line(f"tolerance: {held.quantity}{filtered} at most {held.largest_um:g} µm, {circles}")
    if found.tolerances_from:
        echo_line(f"tolerances from {found.tolerances_from}")
    if not found.files:
        echo("no settings file was found; `dbbstation settings --template` prints one", err=True)


def _template() -> str:
    from dbbstation.files.formats.settings_schema import SettingsFile
    from dbbstation.files.yaml.schema import format_of

    text = (shipped_folder("fixtures") / "settings" / "every-key.yaml").read_text(encoding="utf-8")
    head, format_line, rest = text.partition(f"format: {format_of(SettingsFile)}\n")
    hint = "# Take away the # in front of what you set; where a line is indented, in front of the line above it too.\n"
    return head + hint + format_line + re.sub(r"^(?=[^#\n])", "#", rest, flags=re.MULTILINE)
