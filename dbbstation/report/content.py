"""What a report says: figures, verdict, conditions and drawings, ready for its template."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dbbstation.machine.difference import differences, in_words
from dbbstation.plan.tolerance import OF_A_MODEL
from dbbstation.quality.conformity import Conformity
from dbbstation.report.causes_part import cause_rows, cured_polars
from dbbstation.report.certificate import certified
from dbbstation.report.conditions import conditions, identity, when_measured
from dbbstation.report.model_part import not_visible, parameters, quality_of_fit
from dbbstation.report.plate_map import WIDTH, plate_map
from dbbstation.report.polar import CIRCLE, SIZE, polar
from dbbstation.report.verdict import verdict_of
from dbbstation.results.circles import circled_summary
from dbbstation.results.effects import effect_results
from dbbstation.results.model_warnings import lacks_physics, model_warnings
from dbbstation.results.serialise import plain
from dbbstation.results.tolerances import filter_words, held_against, tolerated_circles, tolerated_pairs

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.circles.path import Filter
    from dbbstation.files.formats.settings import Settings
    from dbbstation.files.provenance import Provenance
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.plan.tolerance import Tolerance
    from dbbstation.report.causes_part import Ranked
    from dbbstation.report.certificate import Certified
    from dbbstation.results.circles import Circled
    from dbbstation.results.tolerances import Held, ToleratedCircle


REASONS_SHOWN = 3
"""Reasons of a verdict on the first page, the table of tolerances has all: U and the room for a signature have to fit the page too."""


@dataclass(frozen=True, eq=False)
class Modelled:
    """A model beside the circles.

    Attributes:
        identified: the model.
        evaluation: what `evaluated` returns; empty where it could not be worked out.
        problem: why it could not; empty where it could.
    """

    identified: IdentifiedModel
    evaluation: Mapping[str, Any]
    problem: str = ""


@dataclass(frozen=True, eq=False)
class Reported:
    """What goes into a report.

    Attributes:
        found: circles as measured, with findings.
        chosen: filter of their figures.
        settings: of the shop, with its tolerances.
        coverage_factor: k of U = k u.
        before: circles measured before; None where none are given.
        modelled: a model beside them; None where none is given.
        job: what was measured for; empty where not said.
        ranked: causes of the model beside the circles; None without a model.
        place: where it was measured; empty where nobody says.
    """

    found: Circled
    chosen: Filter
    settings: Settings
    coverage_factor: float
    before: Circled | None = None
    modelled: Modelled | None = None
    job: str = ""
    ranked: Ranked | None = None
    place: str = ""


def numbers_of(reported: Reported) -> dict[str, Any]:
    """Return the numbers of a report: what its command prints as JSON, and its template shows."""
    tolerances = reported.settings.tolerances
    now = tolerated_circles(reported.found.circles, tolerances)
    now_both = (*now, *tolerated_pairs(reported.found.pairs, tolerances))
    held = held_against(tolerances, now_both, reported.coverage_factor)
    identified = None if reported.modelled is None else reported.modelled.identified
    ranked = reported.ranked
    certificate = certified_of(reported)
    verdict = verdict_of(held, reported.found, reported.coverage_factor, identified, reported.ranked)
    former = reported.before
    before = () if former is None else tolerated_circles(former.circles, tolerances)
    before_both = (*before, *(() if former is None else tolerated_pairs(former.pairs, tolerances)))
    tests = dict.fromkeys(one.test for one in now)
    rows = list(_side_by_side(now, before))
    return {
        "verdict": {
            "kind": verdict.kind,
            "headline": verdict.headline,
            "reasons": list(verdict.reasons),
            "to_do": list(verdict.to_do),
        },
        "certificate": {
            "title": certificate.title,
            "lacking": list(certificate.lacking),
            "place": certificate.place or None,
        },
        "model_warnings": [] if identified is None else list(model_warnings(identified)),
        "coverage_factor": reported.coverage_factor,
        "tolerances": [_held_both(one, now_both, before_both, reported.coverage_factor) for one in tolerances],
        "tolerances_by_test": [
            {
                "test": test,
                **_held_both(one, _of_test(now_both, test), _of_test(before_both, test), reported.coverage_factor),
            }
            for test in tests
            for one in tolerances
            if any(
                one.holds_for(circle.test, circle.direction) and circle.size(one) is not None
                for circle in _of_test(now_both, test)
            )
        ],
        "measured": rows,
        "measured_means": _means(rows),
        "circles": circled_summary(reported.found, reported.chosen),
        "causes": []
        if ranked is None
        else [plain(one) for one in effect_results(ranked.effects, ranked.verdicts or {})],
        "causes_of": None if ranked is None or not ranked.effects else ranked.session,
        "model": None if reported.modelled is None else dict(reported.modelled.evaluation),
    }


def certified_of(reported: Reported) -> Certified:
    """Return what a report lacks to be a certificate."""
    found = reported.found
    shown = [session for session in found.sessions if any(c.session == session.name for c in found.circles)]
    return certified(shown, reported.job, reported.place, tolerances=bool(reported.settings.tolerances))


def content_of(reported: Reported, numbers: Mapping[str, Any], provenance: Provenance) -> dict[str, Any]:
    """Return everything that the template of a report names.

    Args:
        reported: what goes into it.
        numbers: what `numbers_of` returns of it.
        provenance: where it comes from.
    """
    found, modelled = reported.found, reported.modelled
    bad = {one["worst"]["test"] for one in numbers["tolerances"] if one["worst"] and not one["within"]}
    bad |= {one.entry.test for one in found.circles if one.problem or (one.judgement and one.judgement.wrong)}
    return {
        **numbers,
        "machine": found.sessions[0].machine.name,
        "virtual": [session.name for session in found.sessions if session.virtual],
        "job": reported.job or found.sessions[0].job,
        "sessions": [
            {
                "name": session.name,
                "measured": when_measured(c.entry for c in found.circles if c.session == session.name),
                "identity": identity(session),
                "conditions": conditions(
                    session, [c for c in found.circles if c.session == session.name], reported.job
                ),
                "places": plate_map({name: session.plan.tests[name] for name in _tests_of(found, session.name)}, bad),
                "known": all(session.plan.tests[name].ball.place_known for name in _tests_of(found, session.name)),
            }
            for session in found.sessions
            if any(c.session == session.name for c in found.circles)
        ],
        "reasons_shown": REASONS_SHOWN,
        "map_width": WIDTH,
        "polar_size": SIZE,
        "polar_radius": CIRCLE,
        "polars": _polars(reported),
        "causes": _causes(reported),
        "before_name": "" if reported.before is None else reported.before.sessions[0].name,
        "several": len(found.sessions) > 1,
        "findings": _findings(found),
        "not_stated": _not_stated(numbers["circles"]),
        "why_not": _why_not(numbers["circles"]),
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
    }


def _causes(reported: Reported) -> dict[str, Any] | None:
    ranked = reported.ranked
    if ranked is None:
        return None
    return {
        "session": ranked.session,
        "why_not": ranked.why_not,
        "rows": cause_rows(ranked, reported.coverage_factor),
        "polars": cured_polars(ranked),
    }


def _notes_before(reported: Reported) -> list[str]:
    """Return remarks on the circles before: whether they are of another machine, first of all."""
    if reported.before is None:
        return []
    one, other = reported.before.sessions[0].machine, reported.found.sessions[0].machine
    unlike = differences(one, other)
    note = f"The session before is of another nominal machine; before and now: {in_words(unlike)}."
    return [*([note] if unlike else []), *reported.before.warnings]


def _tests_of(found: Circled, session: str) -> list[str]:
    return list(dict.fromkeys(one.entry.test for one in found.circles if one.session == session))


def _of_test(circles: Sequence[ToleratedCircle], test: str) -> list[ToleratedCircle]:
    return [one for one in circles if one.test == test]


def _held_both(
    tolerance: Tolerance, now: Sequence[ToleratedCircle], before: Sequence[ToleratedCircle], coverage_factor: float
) -> dict[str, Any]:
    """Return what one tolerance says of circles now and before; nothing of before where it holds for none of them."""
    (held,) = held_against((tolerance,), now, coverage_factor)
    (former,) = held_against((tolerance,), before, coverage_factor)
    told = None if former.worst is None else _held_data(former, coverage_factor)
    return {**_held_data(held, coverage_factor), "before": told}


def _held_data(held: Held, coverage_factor: float) -> dict[str, Any]:
    worst = held.worst
    size = held.size
    return {
        "quantity": held.tolerance.figure.value,
        "filter": filter_words(held.tolerance),
        "largest_um": held.tolerance.largest_um,
        "tests": list(held.tolerance.tests),
        "directions": [direction.value for direction in held.tolerance.directions],
        "conformity": None if held.conformity is None else str(held.conformity),
        "within": held.conformity in {None, Conformity.WITHIN},
        "exceeded": held.exceeded,
        "undecided": held.undecided,
        "circles": held.circles,
        "worst": None
        if worst is None or size is None
        else {
            "test": worst.test,
            "direction": worst.direction,
            "repeat": worst.repeat,
            "um": size.um,
            "expanded_um": None if size.u_um is None else coverage_factor * size.u_um,
            "why_not": size.why_not or None,
        },
    }


def _side_by_side(now: Sequence[ToleratedCircle], before: Sequence[ToleratedCircle]) -> Iterable[dict[str, Any]]:
    """Yield figures as measured, each with those of the same test, direction and repeat before."""
    former = {one.key: one for one in before}
    for one in now:
        then = former.get(one.key)
        yield {
            "session": one.session,
            "test": one.test,
            "direction": one.direction,
            "repeat": one.repeat,
            "now": _sizes(one),
            "before": None if then is None else _sizes(then),
        }


def _sizes(one: ToleratedCircle) -> dict[str, dict[str, float | None]]:
    return {str(figure): {"um": size.um, "u_um": size.u_um} for figure, size in one.sizes.items()}


def _means(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Mean and largest of each figure; with those before of the circles that were measured both times."""
    both = [row for row in rows if row["before"] is not None]
    taken = both or list(rows)
    return [
        {
            "quantity": figure.value,
            "circles": len(taken),
            "now": _mean_and_largest([row["now"][figure.value]["um"] for row in taken]),
            "before": _mean_and_largest([row["before"][figure.value]["um"] for row in both]),
        }
        for figure in OF_A_MODEL
    ]


def _mean_and_largest(sizes: Sequence[float]) -> dict[str, float] | None:
    return {"mean_um": sum(sizes) / len(sizes), "largest_um": max(sizes)} if sizes else None


def _polars(reported: Reported) -> list[dict[str, Any]]:
    before = () if reported.before is None else reported.before.circles
    tests = dict.fromkeys((one.session, one.entry.test) for one in reported.found.circles if one.analysis is not None)
    several = len(reported.found.sessions) > 1
    return [
        {
            "title": f"{session}: test {test}" if several else f"test {test}",
            "drawing": polar(
                test,
                [
                    c
                    for c in reported.found.circles
                    if (c.session, c.entry.test) == (session, test) and c.analysis is not None
                ],
                [c for c in before if c.entry.test == test and c.analysis is not None],
            ),
        }
        for session, test in tests
    ]


def _findings(found: Circled) -> dict[str, Any]:
    """Return findings that are wrong, run by run, and those that cannot be decided, by what they are."""
    wrong, undecided, good = [], dict[tuple[str, str], list[str]](), 0
    for one in found.circles:
        for finding in () if one.judgement is None else one.judgement.findings:
            if finding.wrong:
                wrong.append((one.session, one.entry.label, finding))
            elif finding.verdict.value == "good":
                good += 1
            else:
                undecided.setdefault((str(finding.name), finding.text), []).append(one.entry.label)
    return {
        "wrong": wrong,
        "undecided": [(name, text, runs) for (name, text), runs in undecided.items()],
        "good": good,
    }


def _not_stated(circles: Mapping[str, Any]) -> list[str]:
    budgets = [
        budget for run in [*circles["runs"], *circles["pairs"]] for budget in run.get("uncertainty", {}).values()
    ]
    return list(dict.fromkeys(cause for budget in budgets for cause in budget["missing"]))


def _why_not(circles: Mapping[str, Any]) -> list[str]:
    """Return why figures have no uncertainty, with their names."""
    of: dict[str, dict[str, None]] = {}
    for run in [*circles["runs"], *circles["pairs"]]:
        for figure, budget in run.get("uncertainty", {}).items():
            if budget["why_not"]:
                of.setdefault(budget["why_not"], {})[figure] = None
    return [f"{', '.join(figures)}: {why}" for why, figures in of.items()]


def _files(reported: Reported, provenance: Provenance) -> Iterable[tuple[str, str]]:
    """Yield name and SHA-256 of every file that the report rests on, recordings too."""
    yield from provenance.inputs.items()
    for found in (reported.found, *(() if reported.before is None else (reported.before,))):
        for one in found.circles:
            yield f"{one.session}/runs/{one.entry.path.name}", one.entry.sha256
            if one.entry.program is not None:
                program = one.entry.program
                yield f"{one.session}/{program.path.parent.name}/{program.path.name}", program.sha256
