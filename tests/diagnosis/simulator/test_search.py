"""Which terms a search asks for beside those that are in, and what is said where simulations are spent."""

from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.diagnosis.simulator.answer import find
from dbbstation.diagnosis.simulator.contract import simulated
from dbbstation.diagnosis.simulator.search import within_forms
from dbbstation.diagnosis.simulator.terms import Term, TermForm
from dbbstation.diagnosis.simulator.work import BudgetSpentError
from tests.diagnosis.simulator.systems import SUBSTEPS, SYSTEMS, model_of


def candidate(port, form):
    term = Term(port, form, () if form is TermForm.CONSTANT else ("x",))
    return SimpleNamespace(name=term.name, term=term)


class Compared:
    """A node with the first of some terms, and a comparison in which each has an effect; a parameter takes up the first row's."""

    def __init__(self, effects):
        every = [candidate(*key) for key in effects]
        self.inside, self.outside, self.names = every[:1], every[1:], [one.name for one in every]
        self.effects = dict(zip(self.names, effects.values(), strict=True))
        self.best = SimpleNamespace(members=every)
        samples = np.array([[1.0], [0.0], [0.0], [0.0]])
        self.channel = SimpleNamespace(residual=np.zeros(4), base=SimpleNamespace(samples=samples))
        self.bank = SimpleNamespace(base_values=lambda effect: 7.0 - effect[:1])

    def effect(self, names):
        return np.sum([self.effects[name] for name in names], axis=0)


ALIKE = np.array([0.0, 1.0, 1.0, 1.0])
OTHER = np.array([0.0, 1.0, -1.0, 0.0])


def test_a_term_less_than_a_spring_may_be_off_by_is_not_asked_for():
    found = Compared(
        {
            ("force", TermForm.CUBIC): 100.0 * ALIKE,  # may be off by 2 % of this
            ("force", TermForm.SLIP): 1.9 * ALIKE + [50.0, 0.0, 0.0, 0.0],  # a parameter takes up most of it
            ("force", TermForm.SQUARE): 2.3 * ALIKE,
            ("sensor", TermForm.LINEAR): 0.1 * ALIKE,  # another port, where nothing is that may be off
        }
    )
    assert within_forms(found, found, found.names[1:]) == [found.names[1]]


def test_terms_that_cancel_each_other_are_as_large_as_what_they_do_together():
    found = Compared(
        {
            ("force", TermForm.CUBIC): 100.0 * ALIKE,
            ("force", TermForm.SQUARE): 30.0 * OTHER + 1.0 * ALIKE,
            ("force", TermForm.DRAG): -30.0 * OTHER,
        }
    )
    assert within_forms(found, found, found.names[1:]) == found.names[1:]
    assert within_forms(found, found, found.names[1:2]) == []


def test_beside_a_constant_which_has_no_form_every_term_is_asked_for():
    found = Compared({("force", TermForm.CONSTANT): 100.0 * ALIKE, ("force", TermForm.LINEAR): 0.1 * ALIKE})
    assert within_forms(found, found, found.names[1:]) == []


@pytest.mark.parametrize(
    ("spent_in", "done"),
    [
        pytest.param("held-out part", 6, marks=pytest.mark.nightly),
        pytest.param("held-out part", 2, marks=pytest.mark.nightly),
        ("put in", 0),
    ],
)
def test_what_was_found_is_said_where_simulations_are_spent(spent_in, done):
    system = SYSTEMS["winding temperature"]
    model, simulator = model_of(system, 1, clean=False), system.make(SUBSTEPS)
    spent, known = [], {}

    def told(text, done_now=0, _of=0):
        if text.startswith(spent_in) and done_now >= done:
            spent.append(text)

    def run(asks):
        if spent and any(ask not in known for ask in asks):
            raise BudgetSpentError("all are spent")
        known.update((ask, simulated(simulator, model, ask)) for ask in asks if ask not in known)
        return [known[ask] for ask in asks]

    answer = find(model, run, progress=told)
    assert answer.stopped == "all are spent"
    # Evidence from four parts and more is given; from fewer it is chance.
    assert (len(answer.held_out.folds) if answer.held_out else 0) in ((6, 7) if done == 6 else (0,))
    assert answer.terms
    if spent_in == "put in":
        assert not answer.identified
        found = [one for one in answer.findings if one.name in {term.name for term in answer.terms}]
        assert found
        assert all(one.verdict == "ambiguous" and "left to test" in one.text for one in found)
