"""Sentences of answers, identical on terminal and screen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dbbstation.results.model_warnings import chance_in_words, exceeds

if TYPE_CHECKING:
    from collections.abc import Iterator

NOT_THIS_MACHINE = 10.0
"""Residual over noise above which the machine file itself is in doubt."""

STILL_OPEN = frozenset({"ambiguous", "not-testable"})


def outlier_sentence(outlier: Any) -> str:  # noqa: ANN401 - a result, or objects
    """Return why a run or a ball is left out of the fit."""
    return f"outlier, kept out of the fit: {outlier.text}"


def unseen_sentence(text: str, *, nominal: bool = True) -> str:
    """Return a sentence on a direction that the tests do not determine."""
    return f"not visible to these tests{', held at nominal' if nominal else ''}: {text}"


def weak_sentence(weak: Any) -> str:  # noqa: ANN401 - a result, or objects
    """Return a sentence on a direction that the tests determine least, with its u."""
    return f"least visible, to {weak.uncertainty:.1f} {weak.unit}: {weak.text}"


def visibility_sentences(found: Any) -> Iterator[str]:  # noqa: ANN401 - a result, or objects
    """Yield sentences on what the tests of a calibration determine, and what they do not."""
    yield f"{found.parameters_identified} parameters identified"
    yield from (unseen_sentence(text, nominal=not found.parameters_prescribed) for text in found.directions_lost)
    if found.directions_lost and not found.parameters_prescribed:
        yield "  a parameter without u takes part in such a direction: its value is no result by itself"
    if found.parameters_prescribed:
        yield f"held at nominal instead: {', '.join(found.parameters_prescribed)}"
    for text in found.directions_regularised:
        yield f"not visible to these tests, known by the machine file's joint tolerance only: {text}"
    for text in found.gaps:
        yield f"  {text}"
    yield from map(weak_sentence, found.observability.weak_directions[:1])


def fit_sentences(found: Any) -> Iterator[str]:  # noqa: ANN401 - a result, or objects
    """Yield sentences on whether a calibration can be trusted."""
    check, misfit = found.plan_check, found.misfit
    if not check.enough:
        yield (
            f"{check.tests} tests are too few to reveal a wrong tilt, height or position in the plan: {check.left} degrees "
            f"of freedom are left to check it, one circle has {check.of_one_test}; a small residual proves nothing here, so "
            "check the tilts by hand or measure further circles"
        )
    if not misfit.missing_physics:
        return
    yield (
        f"{exceeds(misfit.rms_um, misfit.probability)}: physics is missing from the model; `dbbstation diagnose` looks for it. "
        "Until then its parameters may be off by many times their u"
    )
    if found.residual_within_mounting_rms_um > NOT_THIS_MACHINE * found.noise_um:
        yield (
            f"... more than {NOT_THIS_MACHINE:.0f} times the noise: check also that the machine file is this machine's, its "
            "joints in the order of the struts and the rotation convention that of the control"
        )


def residual_lines(found: Any) -> Iterator[str]:  # noqa: ANN401 - a result, or objects
    """Yield the residuals of nominal machine and model, with the noise for comparison."""
    yield f"nominal machine leaves   {found.nominal_rms_um:8.2f} µm rms"
    yield f"model leaves             {found.residual_rms_um:8.2f} µm rms"
    yield f"... within each mounting {found.residual_within_mounting_rms_um:8.2f} µm rms"
    yield f"noise of one reading     {found.noise_um:8.2f} µm"


def use_sentence(found: Any) -> str:  # noqa: ANN401 - a result, or objects
    """Return a sentence on whether a calibration's model can be used, judged by its own figures."""
    check = found.plan_check
    if found.misfit.missing_physics:
        return (
            f"Use this model: no. {found.misfit.rms_um:.2f} µm rms have no explanation; run `dbbstation diagnose` first"
        )
    if not check.enough:
        return (
            f"Use this model: cannot tell. {check.left} degrees of freedom test it, fewer than the {check.of_one_test} of one circle; "
            "measure further circles"
        )
    if any(one.finding == "more" for one in found.scatter):
        return "Use this model: cannot tell. The balls scatter by more than stated; find out why first"
    known = zip("XYZ", found.centre_u_um, strict=True)
    u = ", ".join(f"{axis} {'unknown' if value is None else f'{value:.1f} µm'}" for axis, value in known)
    return (
        f"Use this model: yes, at these places. Its residual is noise; u of the tool there is at most {u}. Elsewhere cannot tell: its "
        "joints may conceal other causes, so try it on another session with `dbbstation evaluate`"
    )


def evaluated_sentence(found: Any) -> str:  # noqa: ANN401 - a result, or objects
    """Return a sentence on whether a model can be used, by its residual in recordings outside its fit."""
    left, nominal = f"{found.residual_rms_um:.2f} µm rms", f"the nominal machine {found.nominal_rms_um:.2f}"
    if not found.held_out:
        return f"Use this model: cannot tell. It was made of these circles, of which it leaves {left}; evaluate another session"
    if found.residual_rms_um >= found.nominal_rms_um:
        return f"Use this model: no. It leaves {left} of these circles, {nominal}"
    return f"Use this model: yes, near these circles, if {left} are good enough. It was not made of them; {nominal}"


def mismatch_sentence(found: Any) -> str:  # noqa: ANN401 - a result, or objects
    """Return a sentence on whether recordings contradict the kinematic model."""
    if not found.mismatch:
        return f"The kinematic model explains these circles (probability {found.probability:.2g})."
    return (
        f"The recordings differ from the kinematic model by {found.misfit_rms_um:.2f} µm rms beyond noise "
        f"(probability by chance {chance_in_words(found.probability)})."
    )


def ending_sentences(found: Any) -> Iterator[str]:  # noqa: ANN401 - a result, or objects
    """Yield sentences on limits that ended a diagnosis, on the agreement of a second search, and on the next measurement."""
    yield from (limit.text for limit in found.limits)
    if found.second_start_agrees is False:
        yield "A second search came to another set of causes: several explain these recordings, take it with care."
    if found.next_test:
        tests = [found.next_test, *found.further_tests]
        which = "this test" if len(tests) == 1 else f"these {len(tests)} tests"
        yield (
            f"measure next: {'; and '.join(test.text for test in tests)}; {which} would bring u of {tests[0].source} "
            f"to {tests[-1].sigma_after:.2g} instead of {tests[0].sigma_before:.2g} {tests[0].unit}"
        )
    elif any(source.verdict in STILL_OPEN and source.gain is not None for source in found.sources):
        yield "measure next: no proposal; up to three further tests would neither change a verdict nor halve u"
