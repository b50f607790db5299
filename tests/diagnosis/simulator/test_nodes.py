"""Refits of a simulator that is linear in all that is fitted: every start leads to the one minimum of linear least squares."""

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.diagnosis.simulator.contract import Simulator, simulated
from dbbstation.diagnosis.simulator.fit import fit
from dbbstation.diagnosis.simulator.model import Model, Output, SimulatorParameter, SimulatorPort, SimulatorRecording
from dbbstation.diagnosis.simulator.nodes import Nodes
from dbbstation.diagnosis.simulator.search import _rivals, compared_quickly
from dbbstation.diagnosis.simulator.terms import TermForm
from dbbstation.diagnosis.simulator.work import FittedState, SimulationRuns
from dbbstation.inference.settle import Beginning

ROWS = 400
T = 0.01 * np.arange(ROWS)
X = np.random.default_rng(1).uniform(-1.0, 1.0, ROWS)
NOISE = 0.01


class Scale(Simulator):
    """A gain of x and an offset, beside what acts at the port."""

    def simulate(self, inputs, parameters, ports):
        x = inputs["x"]
        return {"y": parameters["gain"] * x + parameters["offset"] + ports.load(inputs["t"], {"x": x})}


def work_of(load):
    measured = 2.0 * X - 0.3 + load + NOISE * np.random.default_rng(2).standard_normal(ROWS)
    parameters = (SimulatorParameter("gain", "gain", 1.5), SimulatorParameter("offset", "offset", 0.1))
    run = SimulatorRecording("run", {"t": T, "x": X}, {"y": measured})
    model = Model("scale", parameters, (SimulatorPort("load", "N", {"x": "m"}),), (Output("y", "N"),), (run,))
    return measured, SimulationRuns(model, lambda asks: [simulated(Scale(), model, ask) for ask in asks], np.ones(1))


def begun(work, *forms):
    """Nodes with that without terms, and one with terms of these forms."""
    nodes = Nodes(work)
    base = nodes.base(FittedState((1.5, 0.1)))
    inside = tuple(next(one for one in base.outside if one.term.form is form) for form in forms)
    fitted = fit(work, FittedState((1.5, 0.1), tuple(one.term for one in inside)))
    return nodes, base, replace(base, fitted=fitted, inside=inside)


def left_by(measured, *columns):
    rows = np.column_stack([X, np.ones(ROWS), *columns])
    return measured - rows @ np.linalg.lstsq(rows, measured, rcond=None)[0]


def test_a_minimum_that_is_met_again_from_elsewhere_is_no_better_one():
    measured, work = work_of(0.5 * X**3)
    nodes, base, node = begun(work, TermForm.CUBIC)
    assert node.fitted.residual == pytest.approx(left_by(measured, X**3), abs=1e-6)
    assert nodes.without(node, node.inside[0].name) is base
    assert nodes.bettered == set()


def test_what_a_term_less_leaves_is_that_of_least_squares():
    measured, work = work_of(0.5 * X**3 + 0.2 * X**2)
    nodes, _, node = begun(work, TermForm.CUBIC, TermForm.SQUARE)
    cubic, square = node.inside
    found = nodes.without(node, square.name)
    assert found.inside == (cubic,)
    assert found.fitted.residual == pytest.approx(left_by(measured, X**3), abs=1e-4)


def test_rivals_of_a_missing_term_explain_what_it_does_beside_the_terms_that_are_in():
    """An even term is missing beside an odd one: rivals explain half of what it explains, by least squares beside both."""
    measured, work = work_of(0.5 * X**3 + 0.2 * X**2)
    _, _, node = begun(work, TermForm.CUBIC)
    settled = compared_quickly(node.channel, Beginning.EVERYTHING)
    square = next(one for one in node.outside if one.term.form is TermForm.SQUARE)
    rivals = {one.term.form for one in _rivals(node, settled, square)}

    def explained(column):
        return np.sum(left_by(measured, X**3) ** 2) - np.sum(left_by(measured, X**3, column) ** 2)

    hinge = max(explained(np.maximum(X - place, 0.0)) for place in np.linspace(-0.8, 0.8, 33))
    shares = {TermForm.HINGE: hinge, TermForm.DRAG: explained(X * np.abs(X)), TermForm.SIGN: explained(np.sign(X))}
    for form, share in shares.items():
        assert (form in rivals) is bool(share > 0.5 * explained(X**2)), form
    assert TermForm.HINGE in rivals
