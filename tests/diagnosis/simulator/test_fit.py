"""How many simulations a refit asks for, and what ports return by their short way."""

import numpy as np
import pytest

from dbbstation.diagnosis.simulator.contract import Simulator, simulated
from dbbstation.diagnosis.simulator.fit import fit
from dbbstation.diagnosis.simulator.model import (
    Model,
    Output,
    SimulatorParameter,
    SimulatorPort,
    SimulatorRecording,
)
from dbbstation.diagnosis.simulator.ports import Ports
from dbbstation.diagnosis.simulator.terms import Term, TermForm, evaluator
from dbbstation.diagnosis.simulator.work import FittedState, SimulationRuns

T = np.linspace(0.0, 1.0, 200)


class Line(Simulator):
    def simulate(self, inputs, parameters, ports):  # noqa: ARG002 - nothing acts here
        k = parameters["slope"]
        return {"y": (k + 0.05 * k**2) * inputs["t"] + parameters["offset"]}


def test_a_refit_of_what_is_nearly_linear_asks_for_its_answers_where_it_begins_and_where_it_ends():
    measured = 2.0 * T - 1.0 + 0.01 * np.random.default_rng(1).standard_normal(len(T))
    parameters = (SimulatorParameter("slope", "slope", 1.0), SimulatorParameter("offset", "offset", 0.5))
    run = SimulatorRecording("run", {"t": T}, {"y": measured})
    model = Model("line", parameters, (), (Output("y", ""),), (run,))
    asked = set()

    def count(asks):
        asked.update(asks)
        return [simulated(Line(), model, ask) for ask in asks]

    work = SimulationRuns(model, count, np.ones(1))
    found = fit(work, FittedState((1.0, 0.5)))
    b, a = np.polyfit(T, measured, 1)
    k = (np.sqrt(1.0 + 0.2 * b) - 1.0) / 0.1  # the root of k + 0.05 k² = b
    assert found.state.values == pytest.approx((k, a), abs=1e-4)
    assert found.columns[:, 0] == pytest.approx((1.0 + 0.1 * k) * T, abs=1e-4)
    # Two doses of two parameters where it begins, and where it ends; doses change their size once at each.
    assert len(asked) <= 2 * 2 * 4 + 4


@pytest.mark.parametrize("forms", [(TermForm.CUBIC,), (TermForm.CUBIC, TermForm.DRAG)])
def test_a_port_returns_the_same_for_a_number_and_for_an_array(forms):
    port = SimulatorPort("force", "N", {"x": "m"})
    acting = [evaluator(Term("force", form, ("x",), (-2.0,))) for form in forms]
    ports = Ports((port,), {"force": acting}, records=False)
    x = np.array([-0.7, 0.0, 0.4])
    truth = -2.0 * x**3 + (-2.0 * x * np.abs(x) if len(forms) > 1 else 0.0)
    assert [ports.force(0.1, {"x": value}) for value in x.tolist()] == pytest.approx(truth)
    assert ports.force(np.full(3, 0.1), {"x": x}) == pytest.approx(truth)
    assert ports.force(np.float64(0.1), {"x": x[2]}) == pytest.approx(truth[2])
