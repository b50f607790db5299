"""Found terms as Python code for the simulator."""

from __future__ import annotations

import inspect
import re
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.candidates import basis
from dbbstation.diagnosis.simulator.terms import TermForm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.diagnosis.simulator.answer import SimulatorComparison
    from dbbstation.diagnosis.simulator.terms import Term

_PLAIN = {
    TermForm.CONSTANT: "{a}",
    TermForm.LINEAR: "{a} * x",
    TermForm.SQUARE: "{a} * x**2",
    TermForm.DRAG: "{a} * x * abs(x)",
    TermForm.CUBIC: "{a} * x**3",
    TermForm.SIGN: "{a} * x / math.sqrt(x**2 + {s} ** 2)",
    TermForm.HINGE: "{a} * max(x - {s}, 0.0)",
    TermForm.LIMIT: "{a} * min(max(x, -{s}), {s})",
    TermForm.GAP: "-min(max(x, -{a}), {a})",
    TermForm.PRODUCT: "{a} * x * z",
    TermForm.PERIODIC: "{a} * math.cos({turns} * x) + {b} * math.sin({turns} * x)",
}

_BEHIND = """    if before is not None and {tau} > 0.0:
        rate = (t - before[0]) / {tau}
        behind = before[2] * math.exp(-rate) + (x - before[1]) * math.expm1(-rate) / rate
    else:
        behind = 0.0
    return {out}, (t, x, behind)"""

_APART = """    apart = 0.0 if before is None else min(max(before[2] + before[1] - x, -{half}), {half})
    return {out}, (t, x, apart)"""

_LATE = """    times, values = before or ([], [])
    times, values = [*times, t], [*values, x]
    return float(np.interp(t - {a}, times, values)) - x, (times, values)"""


def missing_code(answer: SimulatorComparison) -> str:
    """Return a Python module with a function per term: `value(t, signals)`, or with a state."""
    lines = [
        f'"""What {_told(answer.model.name)} lacks, as found from its recordings. Add each term at its port."""',
        "",
        "import math",
        *(["import runpy"] if any(term.own is not None for term in answer.terms) else []),
        "",
        "import numpy as np",
    ]
    verdicts = {finding.name: finding for finding in answer.findings}
    for term in answer.terms:
        finding = verdicts.get(term.name)
        if term.own is not None:
            kind = type(term.own)
            lines += ["", "", f"{OWN} = runpy.run_path({inspect.getfile(kind)!r})[{kind.__qualname__!r}]()"]
        lines += ["", "", *_function(term, str(finding.verdict) if finding else "", _values(finding))]
    return "\n".join(lines) + "\n"


def _told(text: str) -> str:
    """Return a text that is safe in a docstring, because a model's name must not become code."""
    return " ".join(text.split()).replace("\\", "/").replace('"', "'")


def _values(finding: object) -> list[str]:
    values = getattr(finding, "values", {})
    return [f"{name}: {one.in_words}" for name, one in values.items()]


def function_name(term: Term) -> str:
    """Return the name of a term's function."""
    words = "_".join([term.port, *term.name.split(" at ")[0].replace("-", " ").split()]).lower()
    return re.sub(r"\W", "_", words)


def _function(term: Term, verdict: str, values: Sequence[str]) -> list[str]:
    a = repr(float(term.amplitudes[0]))
    shape = repr(float(term.shape[0])) if term.shape else "0.0"
    remembers = _body(term, a, shape)
    arguments = "t, signals, before=None" if remembers else "t, signals"
    name = _told(term.name)
    said = [f'    """{name[:1].upper()}{name[1:]}: {verdict}.', "", *(f"    {_told(one)}" for one in values)]
    if remembers:
        said += ["", "    Returns the value and the state; hand the state of the last accepted step back as `before`."]
    signals = [f"    {name} = signals[{signal!r}]" for name, signal in zip("xz", term.signals, strict=False)]
    head = [f"def {function_name(term)}({arguments}):", *said, '    """', *signals]
    if remembers:
        return [*head, remembers]
    if term.form is TermForm.OWN:
        return [*head, f"    return {OWN}.value(t, signals, {_own_numbers(term)!r})"]
    if term.form is TermForm.CURVE:
        return [*head, *_curve(term)]
    b = repr(float(term.amplitudes[1])) if len(term.amplitudes) > 1 else ""
    turns = f"2.0 * math.pi * {term.fixed[1]} / {term.fixed[0]!r}" if term.form is TermForm.PERIODIC else ""
    return [*head, "    return " + _PLAIN[term.form].format(a=a, s=shape, b=b, turns=turns)]


OWN = "own"
"""Name of the user's own physics in the code."""


def _own_numbers(term: Term) -> dict[str, float]:
    assert term.own is not None  # noqa: S101 - asked for by the caller
    return {p.name: float(number) for p, number in zip(term.own.parameters(), term.numbers, strict=True)}


def _curve(term: Term) -> list[str]:
    places = np.linspace(term.fixed[0], term.fixed[-1], POINTS)
    values = basis(term, places) @ np.array(term.amplitudes)
    return [
        f"    places = np.linspace({term.fixed[0]!r}, {term.fixed[-1]!r}, {POINTS})",
        f"    values = {[float(f'{value:.6g}') for value in values]!r}",
        "    return float(np.interp(x, places, values))",
    ]


POINTS = 41
"""Number of points at which a curve is written."""


def _body(term: Term, a: str, shape: str) -> str:
    if term.form is TermForm.MEMORY:
        return _BEHIND.format(tau=shape, out=f"{a} * (x + behind)")
    if term.form is TermForm.LAG:
        return _BEHIND.format(tau=a, out="behind")
    if term.form is TermForm.PLAY:
        return _APART.format(half=a, out="apart")
    if term.form is TermForm.SLIP:
        return _APART.format(half=shape, out=f"-{a} * apart / {shape}")
    return _LATE.format(a=a) if term.form is TermForm.DELAY else ""
