"""Terms as code: what is pasted does what was found."""

import ast
from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.diagnosis.simulator.terms import Term, TermForm, evaluator
from dbbstation.facts.value import Value
from dbbstation.simulators.code import missing_code

T = np.linspace(0.0, 4.0, 401).tolist()
X = np.sin(3.0 * np.array(T)).tolist()
KNOTS = (-1.1,) * 4 + (-0.3, 0.4) + (1.1,) * 4

TERMS = [
    Term("p", TermForm.CONSTANT, (), (2.0,)),
    *(Term("p", form, ("x",), (2.0,)) for form in (TermForm.LINEAR, TermForm.SQUARE, TermForm.DRAG, TermForm.CUBIC)),
    *(Term("p", form, ("x",), (2.0,), (0.3,)) for form in (TermForm.SIGN, TermForm.HINGE, TermForm.LIMIT)),
    *(Term("p", form, ("x",), (2.0,), (0.3,)) for form in (TermForm.MEMORY, TermForm.SLIP)),
    *(Term("p", form, ("x",), (0.25,)) for form in (TermForm.DELAY, TermForm.LAG, TermForm.PLAY, TermForm.GAP)),
    Term("p", TermForm.PRODUCT, ("x", "z"), (2.0,)),
    Term("p", TermForm.PERIODIC, ("x",), (2.0, 3.0), (), (2.0 * np.pi, 2.0)),
    Term("p", TermForm.CURVE, ("x",), (0.1, -0.5, 0.3, 0.7), (), KNOTS),
]


def test_every_form_is_asked():
    assert {term.form for term in TERMS} == set(TermForm) - {TermForm.OWN}


@pytest.mark.parametrize("term", TERMS, ids=lambda term: str(term.form))
def test_the_code_of_a_term_does_what_the_term_does(term):
    answer = SimpleNamespace(model=SimpleNamespace(name="a model"), terms=(term,), findings=())
    names = {}
    exec(missing_code(answer), names)  # noqa: S102 - what the program wrote
    (function,) = [value for name, value in names.items() if name.startswith("p_")]
    remembers = "before" in function.__code__.co_varnames
    value, state = evaluator(term), None
    for t, x in zip(T, X, strict=True):
        signals = {"x": x, "z": 0.5 * x + 1.0}
        found, state = function(t, signals, state) if remembers else (function(t, signals), None)
        # A curve is written out at 41 places: off by an eighth of their distance squared times its bend.
        close = 2e-2 if term.form is TermForm.CURVE else 1e-9
        assert found == pytest.approx(value(t, signals), abs=close)


HOSTILE = 'x"""\nimport os; os.abort()\n"""\\'


def test_no_name_that_somebody_gave_becomes_code():
    """The same statements, whatever the model, the term, the port and the signal are called."""

    def shape(name):
        term = Term(name, TermForm.LINEAR, (name,), (2.0,))
        value = Value(1.0, 0.1, name)
        finding = SimpleNamespace(name=term.name, verdict="identified", values={name: value})
        tree = ast.parse(
            missing_code(SimpleNamespace(model=SimpleNamespace(name=name), terms=(term,), findings=(finding,)))
        )
        return [type(node).__name__ for node in ast.walk(tree)]

    assert shape(HOSTILE) == shape("x")
