"""Options of several tasks, each declared once, and how their numbers are read; the module loads fast."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from dbbstation.nc.limits import LARGEST_ALLOWED_MM
from dbbstation.tasks.declare import File, Files, Names, Option

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.tasks.load import Recorded, Sessions
    from dbbstation.tasks.models import Model as _Model
else:
    Sessions, Recorded, _Model = Files, Files, Any

MODEL = Option("Calibrated model, a file of `calibrate` or `diagnose`.", kind="file", metavar="MODEL.yaml")
"""Scripts may give the model or a result that has one."""
MODEL_WITH_FINDINGS = replace(MODEL, only_with="findings")
Model = Annotated[_Model, MODEL]
FORCE, JSON = Option("Replace existing files."), Option("Print the result as JSON.")
Force = Annotated[bool, FORCE]
Json = Annotated[bool, replace(JSON, flag="--json")]
FIGURE = "Write a figure here, as SVG, PNG or PDF by the ending of its name."
TABLE = "Write the table here, as CSV."
OUTPUTS = {
    "out": "Write the result here.",
    "table": TABLE,
    "figure": FIGURE,
    "page": "Write the page here, as HTML.",
}
"""Help texts of a command's outputs; the metavar names the kind of output."""
MACHINE = Option("Nominal machine: the geometry that its controller uses.", metavar="MACHINE.yaml")
Machine = Annotated[File, replace(MACHINE, kind="file")]
PLAN = Option("Test plan.", metavar="PLAN.yaml")
Plan = Annotated[File, replace(PLAN, kind="file")]
TIME_SCALE = "Factor by which the virtual machine runs faster than real time."
Seed = Annotated[int, Option("Seed of everything random.", least=0)]
DryRun = Annotated[bool, Option("Show what would be written, without writing it.")]
OUT = Option("Write the result here.", kind="file")
ANEW = Option("Compute results again instead of reading stored ones.")
Anew = Annotated[bool, ANEW]
SOURCES = Option("Error sources by name.", metavar="A,B,...")
LawOverTime = Annotated[bool, Option("Fit thermal growth as a function of time, even if temperatures were logged.")]
Method = Annotated[
    Literal["jig", "conv-a", "conv-b"],
    Option(
        "How ball positions are known: from a CMM sheet (jig); not at all (conv-a); from micrometer readings (conv-b)."
    ),
]
FALSE_ALARMS = "Probability of a false alarm over all compared quantities together."
Dialect = Annotated[
    str, Option("NC language of the output: a name, or FILE.py.", metavar="D", setting="program.dialect")
]
StepDeg = Annotated[float, Option("Angle between points [deg].", setting="program.step_deg", least=0.01, most=5.0)]
ClearanceMm = Annotated[
    float, Option("Height of rapid moves above the first point [mm].", setting="program.clearance_mm", least=0.0)
]
BarStaysOn = Annotated[bool, Option("Start and end with the bar on its balls: no rapids, no stops.")]
COLUMNS = "Meaning of a column, such as Winkel=angle:deg or Ist_X=x  [default: by the names]."
CHORD_UM = Option("Greatest distance between a move and the commanded path [µm].", least=0.001, most=1000.0)
TimeS = Annotated[
    float | None,
    Option(
        "Time of the program's start [s], counted from the session's start; for models that depend on time.",
        metavar="S",
    ),
]
Findings = Annotated[bool, Option("Judge every run too: print each number with its limit and verdict.")]
SESSIONS = Option("session folders or session files.", kind="argument", metavar="SESSION...")
SessionPaths = Annotated[Sessions, SESSIONS]
RecordedSessions = Annotated[
    Sessions | Recorded,
    Option("session folders, or what `load` returned of them.", kind="argument", metavar="SESSION...", objects=True),
]
Tests = Annotated[Names, Option("Use these tests only; may be given more than once.", metavar="TEST,...")]
Exclude = Annotated[Names, Option("Leave tests out; may be given more than once.", metavar="TEST,...")]
SOURCE_FILES = Option(
    "Python file with error sources or physics of your own. It is executed. May be given more than once.",
    kind="path",
    metavar="FILE.py",
)
SourceFiles = Annotated[Files, SOURCE_FILES]
SourcePaths = Annotated[tuple[Path, ...], SOURCE_FILES]
HeldOut = Annotated[bool, Option("Leave out the held-out test, which takes most of the time.")]
Filter = Annotated[
    Literal["none", "15", "30", "50", "150"],
    Option(
        "Cut-off of the filter for G, F and H [undulations per revolution]. The filter is Gaussian; only 30 is cut off sharply, as for tolerances."
    ),
]
Prefer = Annotated[
    Literal["accuracy", "position-only"],
    Option("Correct all six axes, or the tool tip alone with A, B and C as programmed."),
]
Strict = Annotated[
    bool, Option("Refuse a program that exceeds the chord error, or in which the control would not reach a feed.")
]
LargestCorrectionMm = Annotated[
    float,
    Option(
        "Refuse a model that shifts any point by more [mm].",
        setting="limits.largest_correction_mm",
        above=0.0,
        most=LARGEST_ALLOWED_MM,
    ),
]
DECIMAL, SEPARATOR = (
    "Decimal sign in the files  [default: from the shop's settings, else detected, else a dot].",
    "Separator of columns  [default: from the shop's settings, else detected, else a comma].",
)
Decimal = Annotated[Literal[".", ","] | None, Option(DECIMAL, setting="numbers.decimal")]
Separator = Annotated[
    Literal["comma", "semicolon", "tab", ",", ";", "\t"] | None,
    Option(SEPARATOR, setting="numbers.separator", metavar="[comma|semicolon|tab]"),
]


def numbers_of(text: str, counts: set[int]) -> list[float]:
    """Return the numbers of a text such as `X,Y,Z`; their count must be among `counts`.

    Raises:
        ValueError: the text has another count or is no list of numbers.
    """
    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(abs(number) < float("inf") for number in numbers):
        wanted = " or ".join({1: "one number", 3: "three", 6: "six numbers with commas"}[one] for one in sorted(counts))
        raise ValueError(f"{text!r} is not {wanted}")
    return numbers


def named_numbers(texts: Iterable[str], counts: set[int]) -> dict[str, list[float]]:
    """Return the numbers of each `NAME=1,2,3`; errors as for `numbers_of`."""
    pairs = [text.partition("=") for text in texts]
    for text in (name for name, equals, _ in pairs if not equals):
        raise ValueError(f"{text!r} lacks its name: write {'1=52.1' if counts == {1} else 'G54=20,-35,-1000'}")
    return {name.strip().upper(): numbers_of(numbers, counts) for name, _, numbers in pairs}


def lengths_by_tool(texts: Iterable[str]) -> dict[int, float]:
    """Return lengths [mm] by tool number from each `TOOL=MM`; errors as for `numbers_of`."""
    found = {}
    for name, (length,) in named_numbers(texts, {1}).items():
        number = name.lstrip("TH")
        if not number.isdecimal():
            raise ValueError(f"{name!r} is not the number of a tool")
        found[int(number)] = length
    return found
