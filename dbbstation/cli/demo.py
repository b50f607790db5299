"""`dbbstation demo`: the whole job on a simulated machine, start to end."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from dbbstation.cli.declared import Answer, made
from dbbstation.cli.output import G_LOW_PASSED, echo, print_table, say
from dbbstation.cli.progress import COUNTED, ENDLESS, ProgressBar
from dbbstation.errors import OutputError
from dbbstation.files.places import unused_path
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.results.demo import ControlWay, DemoCircle, DemoResult


@made()
def demo(
    *,
    out: Annotated[Path | None, replace(o.OUT, kind="folder", metavar="FOLDER")] = None,
    seed: o.Seed = 3,
    quick: Annotated[bool, Option("Three tests instead of fifteen, in both directions.")] = False,
    control: Annotated[Literal["linuxcnc"] | None, Option("Compare four corrections in this control.")] = None,
) -> Answer:
    r"""Measure, calibrate, diagnose, compensate and measure again, on a virtual machine over a real serial line.

    Takes one to two minutes and needs no hardware. Every step is a command that can be typed by hand. The commands are shown as they run. Their files stay in the folder.

    With --control, LinuxCNC drives the machine in four ways: nominal, with compensated programs, with refitted
    parameters, and with a kinematics of the model. To continue an interrupted comparison, repeat the command with the
    same --out.

    \b
    Examples:
      dbbstation demo
      dbbstation demo --quick
      dbbstation demo --out try-it --seed 7
      sudo dbbstation demo --quick --control linuxcnc   (needs LinuxCNC; fifteen minutes)
    """
    from dbbstation.demo.whole_job import QUICK, run_demo

    folder = out or unused_path(Path(), "dbbstation-demo")
    tests = QUICK if quick else None
    if folder.exists() and control is None:
        raise OutputError("the folder exists already", where=str(folder), remedy="name another with --out")
    shown = DemoShown()
    try:
        if control is not None:
            from dbbstation.demo.in_control import run_ways

            ways = run_ways(folder, seed, shown.tell, shown.progress, tests)
            told = {"folder": str(folder), "ways": [asdict(way) for way in ways]}
            return Answer(told, lambda: _print_ways(ways))
        result = run_demo(folder, seed, shown.tell, shown.progress, tests)
    finally:
        shown.bar.end()
    printed = {name: json.loads(text) for name, text in result.printed.items()}
    told = {"folder": str(folder), "runs": [asdict(run) for run in result.runs], **printed}
    return Answer(told, lambda: _print(result))


class DemoShown:
    """Each command on a line, with a bar while it runs."""

    def __init__(self) -> None:
        self.bar = ProgressBar("", ENDLESS)

    def tell(self, command: str) -> None:
        """Begin a command."""
        self.bar.end()
        say(f"$ {command}")
        self.bar = ProgressBar("  running", ENDLESS, passing=True)
        self.bar.show()

    def progress(self, text: str, done: int = 0, of: int = 0) -> None:
        """Show the number of finished circles."""
        if done == 0:
            self.bar.end()
            self.bar = ProgressBar("  circles", COUNTED, passing=True)
        self.bar.show(done, of, text)


def _print(result: DemoResult) -> None:
    from dbbstation.facts.serialise import read_plain
    from dbbstation.facts.value import Value

    echo("\n      centre deviation  mean radial error  circular deviation G   [µm, measured]")
    rows: list[list[object]] = [[run.test, *_sizes(run)] for run in result.runs]
    means: list[object] = ["mean", *_means(result.runs)]
    print_table(["test", "before", "after", " before", " after", "  before", "  after"], [*rows, means])
    echo("before: nominal programs; after: programs compensated with the joint model")
    echo(G_LOW_PASSED)
    echo()
    left_um = result.calibration.residual_within_mounting_rms_um
    echo(f"A kinematic calibration alone leaves {left_um:.1f} µm rms within mountings; the bar's noise is 0.3 µm.")
    for source in result.diagnosis.sources:
        if source.verdict == "identified":
            hidden = 100 * (source.concealed or 0.0)
            for name, number in vars(source.parameters).items():
                echo(
                    f"The diagnosis names {source.name}: {name} {read_plain(Value, vars(number)).in_words}; "
                    f"the kinematic parameters had concealed {hidden:.0f} % of it."
                )
    held_out = result.diagnosis.held_out_rms_um
    if result.diagnosis.held_out == "tested":
        echo(f"Held-out tests are predicted to {held_out.before:.1f} µm rms before, {held_out.after:.1f} after.")
    echo(f"\nThe report says: {result.report.verdict.headline}")
    for rank, one in enumerate(result.report.causes, start=1):
        echo(
            f"Cause {rank} of the errors before: {one.cause}, {one.g_um:.1f} µm of G, {one.centre_um:.1f} µm of the "
            f"centres. {one.cure}"
        )
    echo(f"\neverything is in {result.folder}:")
    for name, what in _CONTENTS:
        echo(f"  {name:<24} {what}")


def _print_ways(ways: Sequence[ControlWay]) -> None:
    echo("\nmeans over the circles [µm, measured], and LinuxCNC's time for them:")
    rows: list[list[object]] = []
    for way in ways:
        of = [run.measured for run in way.runs]
        sizes = (
            [one.centre_deviation_um for one in of],
            [abs(one.mean_radial_error_um) for one in of],
            [run.circularity_30_upr_um.measured for run in way.runs],
        )
        rows.append([way.way, *(f"{sum(each) / len(each):.2f}" for each in sizes), f"{way.seconds:.1f} s"])
    print_table("way, centre, mean radial error, G, time", rows)
    echo("faultless: a machine without errors, measured with the same bar, balls and holders")
    echo(G_LOW_PASSED)


_CONTENTS = (
    ("truth.yaml", "what is really wrong with the virtual machine"),
    ("measured/", "session on the nominal machine"),
    ("kinematic.yaml", "model of the kinematic calibration"),
    ("joint.yaml", "model with what the diagnosis found"),
    ("programs/", "compensated NC programs of the circles"),
    ("verified/", "session with the compensated programs"),
    ("dbbstation-settings.yaml", "tolerances of the demonstration"),
    ("report.html", "all of it to read and print: open it in a browser"),
)


def _sizes(run: DemoCircle) -> list[float]:
    names = ("centre_deviation_um", "mean_radial_error_um", "circularity_30_upr_um")
    return [getattr(one, name) for name in names for one in (run.before, run.after)]


def _means(runs: Sequence[DemoCircle]) -> list[float]:
    columns = zip(*(map(abs, _sizes(run)) for run in runs), strict=True)
    return [sum(column) / len(column) for column in columns]
