"""Options of several tasks, each declared once; loads fast."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from dbbstation.nc.limits import LARGEST_ALLOWED_MM
from dbbstation.tasks.declare import Files, Names, Option

if TYPE_CHECKING:
    from dbbstation.tasks.load import Recorded, Sessions
    from dbbstation.tasks.models import Model as _Model
else:
    Sessions, Recorded, _Model = Files, Files, Any

Model = _Model

SessionPaths = Annotated[Sessions, Option("session folders or session files.", kind="argument", metavar="SESSION...")]
RecordedSessions = Annotated[
    Sessions | Recorded,
    Option("session folders, or what `load` returned of them.", kind="argument", metavar="SESSION...", objects=True),
]
Tests = Annotated[Names, Option("Take these tests only; may be given more than once.", metavar="TEST,...")]
Exclude = Annotated[Names, Option("Leave tests out; may be given more than once.", metavar="TEST,...")]
SourceFiles = Annotated[
    Files,
    Option(
        "Python file with an error source of your own. It is executed. May be given more than once.",
        kind="path",
        metavar="FILE.py",
    ),
]
HeldOut = Annotated[bool, Option("Leave out the held-out tests, so that causes need not predict other tests.")]
Filter = Annotated[
    Literal["none", "15", "30", "50", "150"],
    Option(
        "Filter of G, F and H: its cut-off in undulations per revolution. Gaussian; 30 is cut off sharply, as for tolerances."
    ),
]
Prefer = Annotated[
    Literal["accuracy", "position-only"],
    Option("Correct all six axes, or the tool tip alone with A, B and C as programmed."),
]
Strict = Annotated[
    bool, Option("Refuse a program that misses the chord error, or in which the control would not keep a feed.")
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
Decimal = Annotated[
    Literal[".", ","] | None, Option("Decimal sign in the table  [default: a dot].", setting="numbers.decimal")
]
Separator = Annotated[
    Literal["comma", "semicolon", "tab", ",", ";", "\t"] | None,
    Option(
        "Separator of the table's columns  [default: comma; semicolon with a decimal comma].",
        setting="numbers.separator",
        metavar="[comma|semicolon|tab]",
    ),
]


def model(help_text: str, *, only_with: str = "") -> Option:
    """Return a model as an option: a file; scripts may give the model or a result that has one."""
    return Option(help_text, kind="file", only_with=only_with)
