"""The task of calibration: what it returns, whom it tells, and that it can be stopped."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from dbbstation.errors import InputError, ModelError, OutputError
from dbbstation.files.places import shipped_folder
from dbbstation.tasks.calibrate import STAGES, calibrate
from dbbstation.tasks.evaluate import evaluate
from dbbstation.tasks.load import load
from dbbstation.tasks.telling import READING, StoppedError

SMALL = shipped_folder("fixtures") / "sessions" / "small"


@pytest.fixture(scope="module")
def recorded():
    return load(SMALL)


@pytest.fixture(scope="module")
def result(recorded):
    return calibrate(recorded)


def test_paths_and_loaded_sessions_give_the_same(result):
    by_path = calibrate(str(SMALL))
    assert by_path.to_json() == result.to_json()
    assert [note for note in by_path.notes if "l cw 2 is recording" in note]


def test_the_covariance_is_named_and_its_diagonal_is_that_of_the_uncertainties(result):
    named = {f"{row.source}.{row.parameter}": k for k, row in enumerate(result.covariance.rows)}
    assert sorted(named) == sorted(result.parameters)
    matrix = result.covariance.matrix
    assert matrix.shape == (24, 24)
    assert np.array_equal(matrix, matrix.T)
    unseen = result.model.unseen
    for name, k in named.items():
        along, u = np.sum(unseen[:, k] ** 2), result.parameters[name].uncertainty
        if along > matrix[k, k]:
            assert np.isnan(u), name
        else:
            assert u**2 == pytest.approx(matrix[k, k] + along, rel=1e-9), name
        assert result.covariance.rows[k].unit == result.parameters[name].unit


def test_json_is_what_the_fields_say(result):
    data = json.loads(result.to_json())
    assert data == result.to_dict()
    assert data["residual_rms_um"] == result.residual_rms_um
    assert data["covariance"]["matrix"] == result.covariance.matrix.tolist()
    assert "model" not in data
    assert "drawing" not in data


def test_a_result_is_frozen(result):
    with pytest.raises(FrozenInstanceError):
        result.noise_um = 0.0


def test_every_stage_is_told_in_its_order():
    told = []
    calibrate(SMALL, progress=lambda text, *_: told.append(text))
    stages = [next(stage for stage in (READING, *STAGES) if text.startswith(stage)) for text in told]
    assert list(dict.fromkeys(stages)) == [READING, *STAGES]


@pytest.mark.parametrize("stage", ["reading runs", "fit", "figures"])
def test_it_stops_at_any_stage(stage):
    told = []
    with pytest.raises(StoppedError, match="stopped"):
        calibrate(
            SMALL,
            progress=lambda text, *_: told.append(text),
            stop=lambda: any(text.startswith(stage) for text in told),
        )
    assert sum(text.startswith(stage) for text in told) == 1
    assert told[-1].startswith(stage)


def test_tests_of_loaded_sessions_can_be_chosen(recorded):
    with pytest.raises(InputError, match="no session has a test z"):
        calibrate(recorded, exclude=["z"])
    assert {run.test for run in evaluate(recorded, calibrate(recorded), tests=["a"]).runs} == {"a"}


def test_nothing_to_calibrate_is_said():
    with pytest.raises(ModelError, match="nothing can be calibrated"):
        calibrate(SMALL, sources=["bar-offset"])


def test_an_evaluation_of_the_same_runs_has_the_figures_of_the_fit(recorded, result):
    found = evaluate(recorded, result)
    assert found.residual_rms_um == pytest.approx(result.residual_rms_um, rel=1e-12)
    assert [run.after for run in found.runs] == [run.after for run in result.runs]


def test_a_figure_is_drawn_and_kept_whole(result, tmp_path):
    assert result.plot()._repr_svg_().startswith("<?xml")
    file = tmp_path / "figure.png"
    result.save_figure(file)
    assert file.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(OutputError, match="exists"):
        result.save_figure(file)
    with pytest.raises(OutputError, match=r"\.svg, \.png or \.pdf"):
        result.save_figure(tmp_path / "figure.txt")


def test_a_notebook_shows_the_parameters(result):
    page = result._repr_html_()
    assert page.count("<tr>") == 25
    assert "strut-reference-length" in page
