"""The keys of what every command prints as JSON, one file for each command beside this one.

`python -m tests.cli.golden_json` writes them anew. A key that goes or changes its type breaks programs of others: it takes a line in
the changelog.
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from dbbstation.files.places import shipped_folder

GOLDEN = Path(__file__).parent / "golden"

FIXTURES = shipped_folder("fixtures")
PLANS = shipped_folder("protocols") / "plans"
SMALL = FIXTURES / "sessions" / "small"
MACHINE = FIXTURES / "machines" / "reference.yaml"

PART = """%
G21 G90 G94
G0 X0 Y0 Z-1000 A0 B0 C0
G1 X20 Y5 Z-1000 A0 B0 C0 F500
M2
%
"""

TOKENS = frozenset({"conformity", "dialect", "direction", "finding", "format", "held_out", "quantity", "state", "unit"})
"""Keys whose values are words of a list that other programs compare with."""

NAMED_BY_WHAT_WAS_FOUND = ("parameters", "findings[].values")
"""Objects whose keys are names of what this recording had: their own keys are none of the format."""


def lines_of(folder):
    """Arguments of every command that has a result and needs nobody and no instrument, by the name of its golden file.

    Args:
        folder: empty; models and tables go there.
    """
    model, poses, part = folder / "model.yaml", folder / "poses.csv", folder / "part.ngc"
    poses.write_text("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1000,0,0,0\n10,0,-1000,1,0,0\n")
    part.write_text(PART)
    many = folder / "many"
    shutil.copytree(SMALL, many / "small")
    with_model = [SMALL, "--model", model]
    table = FIXTURES / "tables" / "axis.csv"
    plan = ["--plan", PLANS / "ten-minute-check.yaml", "--machine", MACHINE]
    return {
        "calibrate": ["calibrate", SMALL, "--out", model],
        "evaluate": ["evaluate", *with_model],
        "circles": ["circles", SMALL, "--findings", "--quick-look", "--table", folder / "circles.csv"],
        "diagnose": ["diagnose", SMALL],
        "compare": ["compare", SMALL, FIXTURES / "sessions" / "logged"],
        "predict": ["predict", "--model", model, poses, "--table", folder / "actual.csv"],
        "compensate": ["compensate", part, "--model", model, "--out", folder / "out.ngc"],
        "control-kinematics": ["control", "kinematics", "--model", model, "--out", folder / "dbbkins.comp"],
        "control-parameters": ["control", "parameters", "--model", model, "--out", folder / "genhexkins"],
        "program": ["program", *plan, "--tests", "low", "--model", model, "--out", folder / "programs"],
        "report": ["report", *with_model, "--before", SMALL, "--page", folder / "report.html"],
        "history": ["history", many],
        "export": ["export", SMALL, "--out", folder / "table.csv"],
        "import": ["import", folder / "table.csv", "--out", folder / "imported", *IMPORTED],
        "simulate": ["simulate", plan[1], "--model", model, "--out", folder / "simulated"],
        "check": ["check", SMALL, PLANS / "ten-minute-check.yaml", MACHINE, "--instrument", "heidenhain-nd281b"],
        "session-list": ["session", "list", SMALL],
        "identify": ["identify", FIXTURES / "drives" / "strut.csv"],
        "mismatch": ["mismatch", table, "--measured", "measured_mm", "--simulated", "simulated_mm"],
        "sources": ["sources"],
        "instrument-list": ["instrument", "list"],
        "settings": ["settings"],
    }


IMPORTED = [
    "--plan",
    SMALL / "plan.yaml",
    "--machine",
    SMALL / "machine.yaml",
    *[word for what in ("temperature", "operator", "job", "bar") for word in ("--not-known", what)],
    "--yes",
]


def keys_of(data):
    types, words = defaultdict(set), defaultdict(set)
    _gather(data, "", types, words)
    return "".join(
        f"{path}: {' or '.join(sorted(types[path]))}{_said(words[path])}\n" for path in sorted(types) if path
    )


def _said(words):
    return f" = {' | '.join(sorted(words))}" if words else ""


def _gather(value, path, types, words):
    types[path].add(_kind(value))
    if isinstance(value, dict):
        for key, each in value.items():
            shown = "*" if path.endswith(NAMED_BY_WHAT_WAS_FOUND) else key
            _gather(each, f"{path}.{shown}".removeprefix("."), types, words)
    elif isinstance(value, list):
        for each in value:
            _gather(each, f"{path}[]", types, words)
    elif isinstance(value, str) and path.rpartition(".")[2] in TOKENS:
        words[path].add(value)


def _kind(value):
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, int | float):
        return "number"
    return {dict: "object", list: "list", str: "text"}[type(value)]


def without_place(data):
    return {key: value for key, value in data.items() if key != "provenance"}


def main():
    from tests.cli.conftest import call  # noqa: PLC0415 - it needs pytest, which tests of this file do anyhow

    GOLDEN.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in lines_of(Path(folder)).items():
            outcome = call(*arguments, "--json")
            if outcome.code != 0:
                sys.exit(f"{name}: {outcome.err}")
            text = keys_of(without_place(json.loads(outcome.out)))
            (GOLDEN / f"{name}.txt").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
