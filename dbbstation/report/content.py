"""Content of a report: numbers, conditions, drawings."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from dbbstation.circles.budget import BudgetTerm
from dbbstation.facts.digits import to_its_place
from dbbstation.facts.serialise import as_objects
from dbbstation.machine.geometry import differences, in_words
from dbbstation.model.identified import values_of_machine
from dbbstation.report.certificate import certified
from dbbstation.report.conditions import conditions, identity, when_measured
from dbbstation.report.polar import CIRCLE, SIZE, Polar, cured_polars, polar
from dbbstation.results.circles import NO_CIRCLES, RunWithoutCircle, circles_result, not_stated, why_not
from dbbstation.results.model_warnings import lacks_physics, model_warnings
from dbbstation.results.report import (
    CertificateState,
    NotEvaluated,
    ReportResult,
    compared,
    means_of,
    side_by_side,
    tolerances_by_test,
)
from dbbstation.results.report_verdict import verdict_of
from dbbstation.results.tolerances import tolerated_circles, tolerated_pairs
from dbbstation.results.words import unseen_sentence, weak_sentence

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from dbbstation.circles.path import Filter
    from dbbstation.files.formats.settings import Settings
    from dbbstation.files.provenance import Provenance
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.plan.plan import PlannedTest
    from dbbstation.results.calibration import EvaluationResult
    from dbbstation.results.circles import Circled, CirclesResult
    from dbbstation.results.report_verdict import Ranked


def parameters(identified: IdentifiedModel, coverage_factor: float) -> tuple[tuple[str, str, str, str, str], ...]:
    """Return rows of source, parameter, value, U and unit; a dash for unknown U."""
    rows = []
    for source, parameter, value, u in values_of_machine(identified.model, identified.uncertainties):
        shown = (f"{value:.5g}", "-") if u is None else to_its_place(value, coverage_factor * u)
        rows.append((source, parameter.name, *shown, parameter.unit))
    return tuple(rows)


def quality_of_fit(identified: IdentifiedModel) -> str:
    """Return a sentence on a fit's residual and noise; may be empty."""
    report = identified.report
    keys = ("nominal_rms_um", "residual_within_mounting_rms_um", "noise_um")
    nominal, left, noise = (report.get(key) for key in keys)
    if not (isinstance(nominal, float) and isinstance(left, float) and isinstance(noise, float)):
        return ""
    return (
        f"In its own recordings the model leaves {left:.2f} µm rms within each mounting, the nominal machine {nominal:.1f} µm in all; "
        f"one reading has {noise:.2f} µm of noise."
    )


def not_visible(identified: IdentifiedModel) -> tuple[str, ...]:
    """Return sentences on what a model's recordings could not determine, or determined worst."""
    seen = as_objects(identified.report.get("observability"))
    return (
        *map(unseen_sentence, identified.directions_lost),
        *map(weak_sentence, getattr(seen, "weak_directions", ())),
    )


NUMBER_DIGITS = 10
"""Digits of a report's number: two of a million reports have the same number once in two thousand [birthday problem,
16^10]."""

REASONS_SHOWN = 3
"""Greatest number of reasons on the first page, which also needs space for U and a signature; the table of tolerances
has all."""


@dataclass(frozen=True, eq=False)
class Modelled:
    """A model in addition to the circles."""

    identified: IdentifiedModel
    evaluation: EvaluationResult | None
    problem: str = ""


@dataclass(frozen=True, eq=False)
class Reported:
    """Parts of a report."""

    found: Circled
    chosen: Filter
    settings: Settings
    coverage_factor: float
    before: Circled = NO_CIRCLES
    modelled: Modelled | None = None
    job: str = ""
    ranked: Ranked | None = None
    place: str = ""
    logo: str = ""


def numbers_of(reported: Reported, page: str) -> ReportResult:
    """Return the numbers of a report for JSON and template."""
    tolerances, coverage_factor = reported.settings.tolerances, reported.coverage_factor
    now = tolerated_circles(reported.found.shown, tolerances)
    now_both = (*now, *tolerated_pairs(reported.found.pairs, tolerances))
    modelled, ranked = reported.modelled, reported.ranked
    identified = None if modelled is None else modelled.identified
    former = reported.before
    before = tolerated_circles(former.shown, tolerances)
    before_both = (*before, *tolerated_pairs(former.pairs, tolerances))
    measured = tuple(side_by_side(now, before))
    held = tuple(compared(one, now_both, before_both, coverage_factor) for one in tolerances)
    return ReportResult(
        report=page,
        verdict=verdict_of(
            held, reported.found, coverage_factor, identified, ranked, None if modelled is None else modelled.evaluation
        ),
        certificate=certified_of(reported),
        model_warnings=() if identified is None else model_warnings(identified),
        coverage_factor=coverage_factor,
        tolerances=held,
        tolerances_by_test=tuple(
            tolerances_by_test(
                dict.fromkeys(one.test for one in now), tolerances, (now_both, before_both), coverage_factor
            )
        ),
        measured=measured,
        measured_means=tuple(means_of(measured)),
        circles=circles_result(reported.found, reported.chosen),
        causes=() if ranked is None else ranked.effects,
        causes_of=None if ranked is None or not ranked.effects else ranked.session,
        model=None if modelled is None else modelled.evaluation or NotEvaluated(),
    )


def certified_of(reported: Reported) -> CertificateState:
    """Return what a report needs to be a certificate."""
    found = reported.found
    shown = [session for session in found.sessions if any(c.session == session.name for c in found.circles)]
    return certified(shown, reported.job, reported.place, tolerances=bool(reported.settings.tolerances))


def content_of(reported: Reported, numbers: ReportResult, provenance: Provenance) -> dict[str, object]:
    """Return the template's content other than numbers."""
    found, modelled = reported.found, reported.modelled
    bad = {one.worst.test for one in numbers.tolerances if one.worst is not None and not one.within}
    bad |= {one.entry.test for one in found.circles if one.problem or (one.judgement and one.judgement.wrong)}
    return {
        "machine": found.sessions[0].machine.name,
        "number": hashlib.sha256(provenance.text().encode()).hexdigest()[:NUMBER_DIGITS].upper(),
        "issued": datetime.now().astimezone().date(),
        "virtual": [session.name for session in found.sessions if session.virtual],
        "job": reported.job or found.sessions[0].job,
        "sessions": list(_sessions(reported, bad)),
        "reasons_shown": REASONS_SHOWN,
        "map_width": MAP_WIDTH,
        "polar_size": SIZE,
        "polar_radius": CIRCLE,
        "polars": _polars(reported),
        "ranking": reported.ranked,
        "cured": [] if reported.ranked is None else cured_polars(reported.ranked),
        "before_name": reported.before.sessions[0].name if reported.before.sessions else "",
        "several": len(found.sessions) > 1,
        "findings": _findings(found),
        "not_stated": not_stated(numbers.circles),
        "why_not": why_not(numbers.circles),
        "tolerances_from": reported.settings.tolerances_from,
        "modelled": None
        if modelled is None
        else {
            "problem": modelled.problem,
            "failed": lacks_physics(modelled.identified.report),
            "quality": quality_of_fit(modelled.identified),
            "parameters": parameters(modelled.identified, reported.coverage_factor),
            "not_visible": not_visible(modelled.identified),
        },
        "notes": [*found.warnings, *_notes_before(reported)],
        "files": list(_files(reported, provenance)),
        "provenance": provenance,
        "laboratory": _said(reported, "report.laboratory"),
        "customer": _said(reported, "report.customer"),
        "logo": reported.logo,
        "budget": _budget(numbers.circles),
    }


def _said(reported: Reported, key: str) -> str:
    setting = reported.settings.values.get(key)
    return "" if setting is None else str(setting.value)


def _sessions(reported: Reported, bad: set[str]) -> Iterable[dict[str, object]]:
    for session in reported.found.sessions:
        circles = [one for one in reported.found.circles if one.session == session.name]
        tests = list(dict.fromkeys(one.entry.test for one in circles))
        if circles:
            yield {
                "name": session.name,
                "measured": when_measured(one.entry for one in circles),
                "identity": identity(session),
                "serial": session.serial_number,
                "conditions": conditions(session, circles, reported.job),
                "places": plate_map({name: session.plan.tests[name] for name in tests}, bad),
                "known": all(session.plan.tests[name].ball.place_known for name in tests),
            }


def _notes_before(reported: Reported) -> list[str]:
    if not reported.before.sessions:
        return []
    one, other = reported.before.sessions[0].machine, reported.found.sessions[0].machine
    unlike = differences(one, other)
    note = f"The session before is of another nominal machine; before and now: {in_words(unlike)}."
    return [*([note] if unlike else []), *reported.before.warnings]


def _polars(reported: Reported) -> list[Polar]:
    before = reported.before.shown
    tests = dict.fromkeys((one.session, one.entry.test) for one in reported.found.shown)
    several = len(reported.found.sessions) > 1
    return [
        polar(
            f"{session}: test {test}" if several else f"test {test}",
            [c for c in reported.found.shown if (c.session, c.entry.test) == (session, test)],
            [c for c in before if c.entry.test == test],
        )
        for session, test in tests
    ]


def _findings(found: Circled) -> dict[str, object]:
    wrong, undecided, good = [], dict[tuple[str, str], list[str]](), 0
    for one in found.circles:
        for finding in () if one.judgement is None else one.judgement.findings:
            if finding.wrong:
                wrong.append((one.session, one.entry.label, finding))
            elif finding.verdict.value == "good":
                good += 1
            else:
                undecided.setdefault((str(finding.name), finding.text), []).append(one.entry.label)
    told = [(name, text, runs) for (name, text), runs in undecided.items()]
    return {"wrong": wrong, "undecided": told, "good": good}


def _budget(circles: CirclesResult) -> dict[str, object] | None:
    """Return the standard uncertainties of one circle [µm], a row for each cause and a column for each figure."""
    runs = [one for one in circles.runs if not isinstance(one, RunWithoutCircle)]
    if not runs:
        return None
    run = max(runs, key=lambda one: max(budget.known_um for budget in one.uncertainty.values()))
    budgets = run.uncertainty.values()
    rows: list[tuple[str, list[float | None]]] = [
        (str(cause), [budget.terms_um.get(cause) for budget in budgets])
        for cause in BudgetTerm
        if any(cause in budget.terms_um for budget in budgets)
    ]
    rows.append(("u, all together", [budget.u_um for budget in budgets]))
    return {"run": f"{run.test} {run.direction} {run.repeat}", "figures": list(run.uncertainty), "rows": rows}


def _files(reported: Reported, provenance: Provenance) -> Iterable[tuple[str, str]]:
    yield from provenance.inputs.items()
    for found in (reported.found, reported.before):
        for one in found.circles:
            yield f"{one.session}/runs/{one.entry.path.name}", one.entry.sha256
            if one.entry.program is not None:
                program = one.entry.program
                yield f"{one.session}/{program.path.parent.name}/{program.path.name}", program.sha256


MAP_WIDTH = 420
"""Width and height of the map in drawing units."""

_MAP_MARGIN = 70.0

_SAME_MM = 1.0
"""Largest distance of balls at one position, such as holders of several heights in one bore."""


def plate_map(tests: Mapping[str, PlannedTest], marked: Collection[str]) -> tuple[Mapping[str, object], ...]:
    """Return places of tests; +X is right, +Y up."""
    at: dict[tuple[int, int], list[PlannedTest]] = {}
    for test in tests.values():
        x, y, _ = test.ball.centre_mm
        at.setdefault((round(x / _SAME_MM), round(y / _SAME_MM)), []).append(test)
    xs, ys = [x for x, _ in at], [y for _, y in at]
    width_mm = max(max(xs) - min(xs), max(ys) - min(ys), 1) * _SAME_MM
    scale = (MAP_WIDTH - 2.0 * _MAP_MARGIN) / width_mm
    middle = _SAME_MM * (max(xs) + min(xs)) / 2.0, _SAME_MM * (max(ys) + min(ys)) / 2.0
    return tuple(
        {
            "x": round(MAP_WIDTH / 2.0 + scale * (_SAME_MM * x - middle[0]), 1),
            "y": round(MAP_WIDTH / 2.0 - scale * (_SAME_MM * y - middle[1]), 1),
            "label": _label_of(there),
            "tests": " ".join(test.name for test in there),
            "marked": any(test.name in marked for test in there),
        }
        for (x, y), there in at.items()
    )


def _label_of(there: list[PlannedTest]) -> str:
    bores = list(dict.fromkeys(test.ball.bore for test in there if test.ball.bore is not None))
    if bores:
        return f"bore {', '.join(map(str, bores))}"
    x, y, _ = there[0].ball.centre_mm
    return f"X {x:.0f} Y {y:.0f}"
