"""Of several models of one session the one with most parameters is its history's."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import pytest

from dbbstation.history.record import ModelFigures, ModelParameter, SessionFigures
from dbbstation.tasks import histories as historied

SESSION = SessionFigures("monday", "ab" * 32, "hexapod", None, ())


def model(file, parameters, sessions=None):
    values = tuple(ModelParameter("base-joints", f"joint_{k}_um", 1.0, 0.1, "µm") for k in range(parameters))
    return ModelFigures(file, "cd" * 32, sessions or {"monday": SESSION.sha256}, values)


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_the_model_with_most_parameters_is_taken_in_any_order(order):
    models = [model("a-plain.yaml", 24), model("b-joint.yaml", 31), model("c-small.yaml", 6)]
    taken, notes = historied._of_one_session([models[k] for k in order], [SESSION])
    assert {digest: one.file for digest, one in taken.items()} == {SESSION.sha256: "b-joint.yaml"}
    assert len(notes) == 2
    assert all(note.endswith("are of one session, monday: b-joint.yaml is taken") for note in notes)


def test_a_model_of_another_session_or_of_several_is_none_of_this_one():
    models = [model("other.yaml", 40, {"tuesday": "ef" * 32}), model("both.yaml", 50, {"monday": "a", "tuesday": "b"})]
    taken, notes = historied._of_one_session(models, [SESSION])
    assert taken == {}
    assert len(notes) == 2


def test_what_has_to_be_said_of_a_model_comes_before_other_notes():
    good, bad = model("b-small.yaml", 6), replace(model("a-joint.yaml", 31), warnings=("physics is missing",))
    _, notes = historied._of_one_session([good, bad], [SESSION])
    assert notes == [
        "a-joint.yaml: physics is missing",
        "b-small.yaml and a-joint.yaml are of one session, monday: a-joint.yaml is taken",
    ]
    _, quiet = historied._of_one_session([good], [SESSION])
    assert quiet == []
