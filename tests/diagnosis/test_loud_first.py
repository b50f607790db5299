"""A faint cause may only fit the initial error of a louder law, so it waits until that law is fitted."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.diagnosis.explain import ROUGH, loud
from dbbstation.inference.hypotheses import Hypothesis
from dbbstation.inference.model_comparison import Cause, Member, Variant
from studies.diagnosed import diagnose_sessions
from tests.plant.foreign.sessions import make


def member(name, *, nonlinear=(), named=True):
    variant = Variant(np.array([0]), np.array([1.0]), nonlinear)
    return Member(Cause(name, (variant,), -3.0, named=named), variant, 1.0)


def test_only_causes_that_a_tenth_of_a_law_could_imitate_wait():
    # An error of a tenth of an effect has a hundredth of its squares, and log Bayes factors grow as squares.
    members = (
        member("law", nonlinear=(0.02,)),
        member("just below", nonlinear=(0.1,)),
        member("just above"),
        member("of no law"),
        member("faint, unnamed", named=False),
    )
    factors = (28_000.0, 28_000.0 * ROUGH**2 - 1.0, 28_000.0 * ROUGH**2 + 1.0, 120_000.0, 10.0)
    best = Hypothesis(members, 0.0, factors)
    assert [one.name for one in loud(best).members] == ["law", "just above", "of no law", "faint, unnamed"]


def test_without_a_rough_law_none_waits():
    best = Hypothesis((member("gravity"), member("spike")), 0.0, (120_000.0, 5.0))
    assert loud(best).members == best.members


@pytest.mark.nightly
def test_a_short_wind_up_is_no_spike(tmp_path):
    """Struts wind up over some hundredths of a millimetre, at 25 readings a second beside three other causes."""
    make(tmp_path, 53, 92, wide=True)
    summary = diagnose_sessions([tmp_path / "0092"], None, (), lambda _: None).summary()
    named = {s["name"]: s for s in summary["sources"] if s["verdict"] in {"identified", "ambiguous"}}
    assert set(named) == {"gravity", "screw-cyclic", "ball-form", "backlash"}
