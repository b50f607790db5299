"""Sessions as trends: what belongs together, and at which rate it is watched."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from dbbstation.history.record import Figure, ModelFigures, ModelParameter, RunFigures, SessionFigures
from dbbstation.history.run_length import average_run_length
from dbbstation.history.trend import TrendOptions, histories
from dbbstation.plan.plan import Direction
from dbbstation.plan.tolerance import CircleFigure, Tolerance
from dbbstation.results.history import history_result

ASKED = TrendOptions(2.0)


def run(test="a", direction="ccw", circle="here", g=10.0, u=1.0):
    return RunFigures(test, direction, circle, (Figure("G", g, u), Figure("X", 2.0, u), Figure("C", 2.0, u)))


def session(week, *runs, machine="m", **more):
    started = datetime(2026, 1, 1, tzinfo=UTC) + timedelta(weeks=week)
    return SessionFigures(f"w{week}", f"sha{week}", machine, started, runs or (run(),), **more)


def trend(machine, label):
    return next(one for one in machine.trends if one.label == label)


def test_repeats_are_one_value():
    (machine,) = histories([session(0, run(g=10.0, u=3.0), run(g=14.0, u=4.0))], {}, ASKED)
    g = trend(machine, "G a ccw")
    assert g.values.tolist() == [12.0]
    assert g.u.tolist() == pytest.approx([(12.5) ** 0.5])


def test_another_circle_under_the_same_name_is_another_quantity():
    (machine,) = histories([session(0), session(1, run(circle="there")), session(2)], {}, ASKED)
    assert trend(machine, "G a ccw (here)").at.tolist() == [0, 2]
    assert trend(machine, "G a ccw (there)").at.tolist() == [1]


def test_the_rate_is_that_of_all_watched_quantities_of_a_machine():
    runs = (run(), run(test="b"))
    (machine,) = histories([session(k, *runs) for k in range(30)], {}, TrendOptions(2.0, false_alarms=0.01))
    assert average_run_length(machine.chart) == pytest.approx(4 / 0.01, rel=1e-4)
    assert machine.expected == pytest.approx(0.01 * 29)


@pytest.mark.parametrize(("at", "count"), [(7, 8), (7, 16), (15, 16)])
def test_a_tenth_of_a_millimetre_in_x_is_seen_in_the_eighth_and_in_the_sixteenth_session(rng, at, count):
    """u of 0.6 µm, by which sessions scatter, too: stated U decides up to the tenth session, their scatter from the eleventh on."""

    def figures(week):
        noise = 0.6 * rng.standard_normal(3)
        x_um = 2.0 + noise[1] + (100.0 if week >= at else 0.0)
        figures = zip("GXY", (10.0 + noise[0], x_um, noise[2]), strict=True)
        return RunFigures("a", "ccw", "here", tuple(Figure(name, value, 0.6) for name, value in figures))

    (machine,) = histories([session(week, figures(week)) for week in range(count)], {}, ASKED)
    found = {label: trend(machine, f"{label} a ccw").watched for label in "GXY"}
    assert not found["G"].events
    assert not found["Y"].events
    (event,) = found["X"].events
    # Seen at once; that it is no single session that stands out is known with the next one.
    assert (event.found, event.since, event.by_stated) == (at if at == count - 1 else at + 1, at, at < 10)
    assert event.difference == pytest.approx(100.0, abs=4.0 * 0.6)


def test_machines_are_apart_and_in_the_order_of_their_names():
    found = histories([session(0, machine="b"), session(1, machine="a"), session(2, machine="b")], {}, ASKED)
    assert [(one.machine, [s.name for s in one.sessions]) for one in found] == [("a", ["w1"]), ("b", ["w0", "w2"])]


def test_sessions_are_taken_in_the_order_of_their_dates():
    (machine,) = histories([session(2, run(g=3.0)), session(0, run(g=1.0)), session(1, run(g=2.0))], {}, ASKED)
    assert trend(machine, "G a ccw").values.tolist() == [1.0, 2.0, 3.0]


def test_an_uncertainty_of_nothing_is_none():
    (machine,) = histories([session(k, run(u=0.0)) for k in range(20)], {}, ASKED)
    assert trend(machine, "G a ccw").why_not == "its uncertainty is not known"
    assert machine.chart is None


def model(number, value, *others, u=0.001):
    parameters = [ModelParameter("gravity", "mass", value, u, "kg")]
    parameters += [ModelParameter(name, "size", 0.0, None, "mm") for name in others]
    return ModelFigures(f"m{number}.yaml", f"h{number}", {f"w{number}": f"sha{number}"}, tuple(parameters))


def test_parameters_beside_other_sources_are_not_compared():
    models = {f"sha{k}": model(k, float(k), *(["warm"] if k == 1 else [])) for k in range(3)}
    (machine,) = histories([session(k) for k in range(4)], models, ASKED)
    assert trend(machine, "gravity mass (beside warm)").values.tolist() == [1.0]
    alone = trend(machine, "gravity mass (alone)")
    assert (alone.at.tolist(), alone.values.tolist(), alone.subject.unit) == ([0, 2], [0.0, 2.0], "kg")
    assert trend(machine, "warm size").why_not == "its uncertainty is not known"


def test_the_smallest_limit_that_holds_counts():
    tolerances = (
        Tolerance(CircleFigure.CIRCULAR_DEVIATION, 20.0),
        Tolerance(CircleFigure.CIRCULAR_DEVIATION, 12.5, tests=("a",), directions=(Direction.CCW,)),
    )
    sessions = [session(0, run(), run(direction="cw"), run(test="b", g=11.0))]
    (machine,) = histories(sessions, {}, TrendOptions(2.0, tolerances))
    assert [trend(machine, f"G {name}").limit for name in ("a ccw", "a cw", "b ccw")] == [12.5, 20.0, 20.0]
    result = history_result([machine], TrendOptions(2.0, tolerances))
    said = {one.quantity: one.conformity for one in result.machines[0].quantities}
    assert (said["G a ccw"], said["X a ccw"]) == ("within", None)


def test_what_else_is_new_stands_beside_a_change():
    scatter = [0.3, -0.2, 0.1, -0.4, 0.2, 0.0, -0.1, 0.4, -0.3, 0.1] * 3
    sessions = [
        session(k, run(g=10.0 + scatter[k] + 9.0 * (k >= 20)), bar="old" if k < 20 else "new", programs="p" * (k >= 20))
        for k in range(30)
    ]
    result = history_result(histories(sessions, {}, ASKED), ASKED)
    (change,) = result.machines[0].changes
    assert change.since.name == "w20"
    assert change.beside == ("another bar, new after old", "compensated programs from here")
    assert [one.quantity for one in change.quantities] == ["G a ccw"]
    rows = result.rows()
    assert len(rows) == 90
    assert [row["session"] for row in rows if row["event"] == "changed"] == [change.found.name]


def test_tests_can_be_chosen():
    (machine,) = histories([session(0, run(), run(test="b"))], {}, TrendOptions(2.0, exclude=("a",)))
    assert {one.subject.test for one in machine.trends} == {"b"}
