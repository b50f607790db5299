"""Several outputs: one amplitude, each output its noise; and which input would distinguish two terms."""

import numpy as np
import pytest

from dbbstation.diagnosis.simulator.contract import simulated
from dbbstation.diagnosis.simulator.fit import fit
from dbbstation.diagnosis.simulator.model import Model, Output, SimulatorParameter, SimulatorPort, SimulatorRecording
from dbbstation.diagnosis.simulator.nodes import Nodes, RanAwayError
from dbbstation.diagnosis.simulator.terms import Term, TermForm
from dbbstation.diagnosis.simulator.trials import apart, trial_inputs
from dbbstation.diagnosis.simulator.work import FittedState, SimulationRuns
from dbbstation.inference.coloured import spread_by_kind
from tests.diagnosis.simulator.systems import held

T = 0.1 * np.arange(200)


class Lagging:
    """A first-order lag of an input, and a gauge of what is stored that shows twice as much."""

    def simulate(self, inputs, parameters, ports):
        x, found = 0.0, []
        for k, t in enumerate(T.tolist()):
            found.append(x)
            more = ports.flow(t, {"level": x})
            x += 0.1 * (inputs["u"][k] - parameters["rate"] * x + more)
        return {"level": np.array(found), "gauge": 2.0 * np.array(found)}


PORTS = (SimulatorPort("flow", "1/s", {"level": ""}),)


def work(rng, noise=(0.01, 0.1), inputs=None):
    u = held(rng, 200, 10, 1.0) if inputs is None else inputs
    model = Model(
        "lag",
        (SimulatorParameter("rate", "rate", 0.5, low=0.01),),
        PORTS,
        (Output("level", "m"), Output("gauge", "V")),
        (SimulatorRecording("run", {"t": T, "u": u}, {"level": T, "gauge": T}),),
    )

    def run(asks):
        return [simulated(Lagging(), model, ask) for ask in asks]

    true = SimulationRuns(model, run, np.ones(2)).simulated([FittedState((0.6,))])[0].reshape(2, -1)
    measured = {
        name: values + sigma * rng.standard_normal(200)
        for name, values, sigma in zip(("level", "gauge"), true, noise, strict=True)
    }
    model = Model(
        model.name, model.parameters, PORTS, model.outputs, (SimulatorRecording("run", {"t": T, "u": u}, measured),)
    )
    return SimulationRuns(model, run, np.ones(2))


def test_each_output_has_a_noise_of_its_own(rng):
    runs = work(rng)
    node = Nodes(runs).base(FittedState((0.5,)))
    channel = node.channel
    assert channel.levels is not None
    from dbbstation.inference.bank import Bank  # noqa: PLC0415 - where it is used

    bank = Bank(channel)
    bank.measures_beside_members = True
    noise = bank.measure(())
    for k, sigma in enumerate((0.01, 0.1)):
        found = noise.sigma * bank.spread[runs.output == k].mean()
        assert found == pytest.approx(sigma, rel=3.0 / np.sqrt(400.0))  # three standard uncertainties of 200 rows


def test_kinds_of_rows_have_the_root_mean_square_of_their_own():
    kinds = np.array([0, 0, 1, 1, 1, 1])
    powers = np.array([1.0, 3.0, 8.0, 8.0, 10.0, 6.0])
    found = spread_by_kind(powers, kinds)
    assert found[0] / found[2] == pytest.approx(0.5)  # root of 2 over 8
    assert np.mean(found**2) == pytest.approx(1.0)


def test_a_larger_input_tells_a_cubic_from_a_line_and_is_proposed(rng):
    runs = work(rng, inputs=held(rng, 200, 10, 0.2))
    cubic = Term("flow", TermForm.CUBIC, ("level",), (-0.4,))
    drag = Term("flow", TermForm.DRAG, ("level",), (-0.1,))
    state = fit(runs, FittedState((0.5,), (cubic,))).state
    trials = trial_inputs(runs.model)
    assert trials[0].about == "the inputs as recorded"
    sigmas = {one.about: apart(runs, one, state, (cubic, drag), np.array([0.01, 0.1])) for one in trials}
    assert sigmas["2 times the inputs"] > 2.0 * sigmas["the inputs as recorded"]
    assert sigmas["0.5 times the inputs"] < sigmas["the inputs as recorded"]


def test_a_simulator_without_inputs_has_no_trial():
    recorded = SimulatorRecording("run", {"t": T}, {"level": T})
    assert trial_inputs(Model("m", (), PORTS, (Output("level", "m"),), (recorded,))) == []


def test_a_term_with_which_simulations_run_away_is_given_up_and_not_the_whole_comparison(rng):
    runs = work(rng)
    away = Term("flow", TermForm.CUBIC, ("level",), (1e6,))
    with pytest.raises(RanAwayError, match="ran away"):
        fit(runs, FittedState((0.5,), (away,)))


def test_a_refit_begins_where_a_term_leaves_least_and_not_where_its_linear_answer_points(rng):
    runs = work(rng)
    nodes = Nodes(runs)
    node = nodes.base(FittedState((0.5,)))
    one = next(each for each in node.outside if each.term.form is TermForm.SQUARE)
    # Nothing is missing, so the less of it the better.
    begun = nodes._beginnings(node, one, np.array([-0.2]))
    assert [state.terms[0].amplitudes[0] for state in begun] == pytest.approx([-0.02, -0.06, -0.2])
    # A term of which any amount makes the simulation run away is begun nowhere.
    assert nodes._beginnings(node, one, np.array([1e6])) == []
