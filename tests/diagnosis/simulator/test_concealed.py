"""Concealed effects in simulators, and twins in which nothing is missing: right or honestly ambiguous, none wrong."""

from dataclasses import replace

import pytest

from tests.diagnosis.simulator.systems import SYSTEMS, asked, verdict_of

pytestmark = pytest.mark.usefixtures("few_parts")


def shorter(system, rows):
    """The same system, recorded for so many rows."""
    return replace(system, inputs=lambda rng: {name: values[:rows] for name, values in system.inputs(rng).items()})


def expect_right(name, seed=1, rows=None):
    system = shorter(SYSTEMS[name], rows)
    answer = asked(system, seed)
    assert verdict_of(system, answer) == "right", [(f.name, f.verdict, f.probability) for f in answer.findings[:4]]
    found = answer.identified[0]
    for value_name, truth in system.values.items():
        value = found.values[value_name]
        assert abs(value.value - truth) < 3.0 * value.uncertainty, (value_name, value)
    assert answer.held_out is not None
    assert answer.held_out.after < 1.3 * system.noise
    return answer


@pytest.mark.nightly  # by the command it is in CI, with its value: tests/cli/test_mismatch_simulator.py
def test_quadratic_drag_is_found_behind_the_damping_that_hid_it():
    answer = expect_right("pendulum drag")
    damping = next(one for one in answer.parameters if one.name == "damping")
    assert damping.confounded > 0.5
    assert damping.refitted.value > 0.4  # refitted without the drag it stands for it
    assert abs(damping.corrected.value - 0.3) < 4.0 * damping.corrected.uncertainty


@pytest.mark.nightly  # a term over a simulated place, the hardening spring, is in CI
def test_a_term_over_a_simulated_level_is_found():
    expect_right("winding temperature")


def test_a_hardening_spring_is_found_whose_linear_answer_is_far_from_the_true_one():
    expect_right("hardening spring", rows=250)


@pytest.mark.parametrize(
    "name", ["pendulum drag", pytest.param("winding temperature", marks=pytest.mark.nightly), "creep"]
)
def test_nothing_is_named_where_nothing_is_missing(name):
    answer = asked(SYSTEMS[name], 3, clean=True)
    assert not answer.identified
    assert not answer.terms
    assert answer.left.is_noise


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", SYSTEMS)
def test_no_effect_is_called_by_a_wrong_name(name, seed):
    system = SYSTEMS[name]
    assert verdict_of(system, asked(system, seed)) in {"right", "ambiguous"}


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [11, 12])
@pytest.mark.parametrize("name", SYSTEMS)
def test_nothing_is_named_in_twins(name, seed):
    assert not asked(SYSTEMS[name], seed, clean=True).identified
