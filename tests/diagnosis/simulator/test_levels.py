"""What parts of a simulator's recordings say of the signals that terms follow."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.diagnosis.simulator.candidates import candidates
from dbbstation.diagnosis.simulator.held import PredictedPart, gains_of
from dbbstation.diagnosis.simulator.laws import law_of_term
from dbbstation.diagnosis.simulator.model import SimulatorPort
from dbbstation.diagnosis.simulator.terms import TermForm


def law_of(candidate):
    return law_of_term(candidate, columns=lambda _: np.zeros((1, 1)), plausible=np.ones(1), parameters=(), units=())


def test_terms_follow_signals_at_their_port():
    rng = np.random.default_rng(1)
    signals = {"joint": {"t": np.arange(60.0), "x": rng.standard_normal(60), "v": rng.standard_normal(60)}}
    found = {one.term.form: one for one in candidates((SimulatorPort("joint", "N", {"x": "m", "v": "m/s"}),), signals)}
    assert law_of(found[TermForm.PRODUCT]).followed == ("x at joint", "v at joint")
    assert law_of(found[TermForm.CONSTANT]).followed == ("port joint",)
    assert (
        law_of(found[TermForm.MEMORY]).way,
        law_of(found[TermForm.SLIP]).way,
        law_of(found[TermForm.LINEAR]).way,
    ) == (
        "late",
        "direction",
        "",
    )


def test_a_signal_that_is_marked_comes_after_others():
    rng = np.random.default_rng(1)
    signals = {"joint": {"t": np.arange(60.0), "x": rng.standard_normal(60), "torque": rng.standard_normal(60)}}
    units = {"x": "m", "torque": "N m"}
    plain = {one.name: one for one in candidates((SimulatorPort("joint", "N", units),), signals)}
    port = SimulatorPort("joint", "N", units, results=frozenset({"torque"}))
    marked = {one.name: one for one in candidates((port,), signals)}
    for name, one in marked.items():
        follows = "torque" in one.term.signals
        assert one.driven == (frozenset({"torque"}) if follows else frozenset())
        assert plain[name].log_odds - one.log_odds == pytest.approx(np.log(19.0) if follows else 0.0)


def test_errors_of_parts_are_pooled_by_rows():
    """Two parts of 10 and 30 rows: root of the mean square over all rows; gains are those of the parts."""
    key = frozenset({"x at joint"})
    parts = tuple(
        PredictedPart(
            name=str(rows),
            rows=rows,
            as_simulated=9.0,
            before=8.0,
            after=after,
            where=np.arange(40) < rows,
            of_classes={frozenset(): (7.0, 5.0), key: (gain, without)},
        )
        for rows, after, gain, without in ((10, 1.0, 4.0, 2.0), (30, 2.0, 6.0, 4.0))
    )
    found = gains_of(parts).of({"x at joint"})
    assert found.gains.parts == (4.0, 6.0)
    assert found.gains.rows == (10, 30)
    assert found.before == pytest.approx(np.sqrt((10 * 4.0 + 30 * 16.0) / 40))
    assert found.after == pytest.approx(np.sqrt((10 * 1.0 + 30 * 4.0) / 40))
    assert found.predicts
    assert gains_of(parts).of(None).gains.total == 14.0
