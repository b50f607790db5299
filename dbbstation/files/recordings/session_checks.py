"""Check a session file against its plan and the disk."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from dbbstation.facts.quantities import twice
from dbbstation.files.formats.session import sealed_or_part
from dbbstation.files.recordings.run_csv import changed
from dbbstation.files.source_text import read_bytes
from dbbstation.plan.circle import USUAL_STROKE_MM

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.errors import Problem
    from dbbstation.files.yaml.text import Location, YamlDocument
    from dbbstation.plan.plan import Plan

_RECORDING = "recording"


def check_runs(document: YamlDocument, plan: Plan | None, folder: Path, faults: list[Problem]) -> None:
    """Check runs in the raw data, with plan and disk, independently of other faults."""
    runs = document.entries("runs")
    for key, what in ((("test", "direction", "repeat"), "this run"), (("file",), "this file")):
        values = [tuple(map(str, map(run.get, key))) for _, run in runs]
        for index in twice(values):
            shown = " ".join(values[index])
            text = f"{what} ({shown}) stands here a second time"
            faults.append(document.problem(runs[index][0], text, "give each run its own repeat and file"))
    for location, run in runs:
        test, direction = run.get("test"), run.get("direction")
        if plan is not None and isinstance(test, str):
            if test not in plan.tests:
                what = f"the plan has no test `{test}`: this is a run of another plan"
                faults.append(document.problem((*location, "test"), what, f"its tests: {', '.join(plan.tests)}"))
            elif direction in ("ccw", "cw") and direction not in plan.tests[test].directions:
                what = f"the plan does not run test {test} {direction}: this is a run of another plan"
                faults.append(document.problem((*location, "direction"), what, "check plan and run"))
        _check_file(document, location, run, folder, faults)
        if isinstance(run.get("program"), dict):
            _check_file(document, (*location, "program"), run["program"], folder, faults)


def check_bar(
    document: YamlDocument, length_mm: float, stroke_mm: float | None, plan: Plan, faults: list[Problem]
) -> None:
    """Check that the bar can run the circles of the plan."""
    fault = unlike_bar(length_mm, stroke_mm, plan)
    if fault is not None:
        faults.append(document.problem(("bar", "calibrated_length_mm"), *fault))


def _check_file(
    document: YamlDocument,
    location: Location,
    entry: dict[str, object],
    folder: Path,
    faults: list[Problem],
) -> None:
    file, expected = entry.get("file"), entry.get("sha256")
    if not isinstance(file, str):
        return
    path = sealed_or_part(folder / file)
    if not path.is_file() and entry.get("state") == _RECORDING:
        return  # a run that died: nothing is worked out of it, `check` names it
    if not path.is_file():
        what = f"there is no file `{file}` in the session folder"
        faults.append(document.problem((*location, "file"), what, "restore it, or take the entry out"))
    elif isinstance(expected, str):
        data = read_bytes(path, faults, is_input=False)
        if data is not None and hashlib.sha256(data).hexdigest() != expected:
            faults.append(changed(str(path)))


def unlike_bar(length_mm: float, stroke_mm: float | None, plan: Plan) -> tuple[str, str] | None:
    """Return fault and remedy if tests need another bar, or None.

    Args:
        stroke_mm: travel of the gauge either way; None if not known.
    """
    stroke = USUAL_STROKE_MM if stroke_mm is None else stroke_mm
    out = {
        name: test.circle.bar_mm for name, test in plan.tests.items() if abs(test.circle.bar_mm - length_mm) > stroke
    }
    if not out:
        return None
    radii = ", ".join(f"{radius:g}" for radius in sorted(set(out.values())))
    names = ", ".join(list(out)[:_MOST_NAMED]) + (
        f" and {len(out) - _MOST_NAMED} more" if len(out) > _MOST_NAMED else ""
    )
    source = "" if stroke_mm is not None else ", as none is stated"
    what = (
        f"a bar of {length_mm:g} mm with a stroke of {stroke:g} mm either way{source} cannot run circles of radius_mm "
        f"{radii} (test {names})"
    )
    return what, "give the calibrated length of the bar that is used (it is held against the plan only), or its plan"


_MOST_NAMED = 4
