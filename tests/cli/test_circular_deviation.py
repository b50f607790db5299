"""Tables that stand side by side mean one thing by circular deviation, and each says which."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dbbstation.cli.demo import _print
from dbbstation.cli.output import G_LOW_PASSED, G_WITH_NOISE
from dbbstation.demo.whole_job import _side_by_side
from dbbstation.facts.serialise import as_objects
from dbbstation.results.demo import DemoResult

NOISE_UM = 0.3
"""Of one reading of the bar in the recorded sessions."""


def rows_after(text, heading):
    lines = text.splitlines()
    start = next(k for k, line in enumerate(lines) if heading in line)
    rows = []
    for line in lines[start + 2 :]:
        if not re.match(r"\S+ +(ccw|cw) ", line):
            break
        rows.append(line.split())
    return rows


@pytest.fixture(scope="module")
def printed(run, elsewhere, model):
    return run("evaluate", elsewhere, "--model", model).out


@pytest.fixture(scope="module")
def numbers(run, elsewhere, model):
    return run("evaluate", elsewhere, "--model", model, "--json").data


def test_both_tables_of_evaluate_have_one_measured_circular_deviation(printed):
    first, second = (rows_after(printed, title) for title in ("mean radial error", "G up to 30 undulations"))
    assert len(first) == len(second) == 6
    assert [row[7] for row in first] == [row[3] for row in second]
    assert G_LOW_PASSED in printed


def test_low_passed_deviations_hold_less_noise(numbers):
    """Of n white readings the range is about 5 to 7 standard deviations; 61 of n low harmonics keep sqrt(61 / n) of it."""
    with_noise = np.mean([one["after"]["circularity_um"] for one in numbers["runs"]])
    without = np.mean([one["circularity_30_upr_um"]["after"] for one in numbers["runs"]])
    assert with_noise > 4.0 * NOISE_UM
    assert without < 0.8 * with_noise


def test_the_demonstration_means_what_evaluate_means(capsys, tmp_path, printed, numbers):
    measured = as_objects(numbers)
    cause = {"name": "play", "verdict": "ruled-out", "concealed": None, "parameters": {}}
    held_out = {"held_out": "tested", "held_out_rms_um": {"before": 7.0, "after": 0.2}}
    result = DemoResult(
        tmp_path,
        _side_by_side(measured, measured),
        as_objects({"residual_within_mounting_rms_um": 3.0}),
        as_objects({"sources": [cause], **held_out}),
        as_objects({"verdict": {"headline": "Nothing is held against anything."}, "causes": []}),
        printed={},
    )
    _print(result)
    said = capsys.readouterr().out
    assert G_LOW_PASSED in said
    evaluated = {row[0]: row[3] for row in rows_after(printed, "G up to 30 undulations") if row[1] == "ccw"}
    shown = {row[0]: row[5:7] for row in map(str.split, said.splitlines()) if row and row[0] in evaluated}
    assert shown == {test: [value, value] for test, value in evaluated.items()}


def test_calibrate_says_that_noise_is_in_it(run, fifteen):
    assert G_WITH_NOISE in run("calibrate", fifteen).out
