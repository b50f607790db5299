"""Laws written once, in a strut, a drive, a table and at a port: against things that move step by step, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.diagnosis.drive.signals import signals_of
from dbbstation.diagnosis.drive.sources import force, known_drive_sources
from dbbstation.diagnosis.simulator.terms import Term, TermForm, evaluator
from dbbstation.diagnosis.table.data import Table
from dbbstation.inference.bent import LawRows, memory_laws
from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.patterns import Family, patterns
from dbbstation.laws.contract import Scale
from dbbstation.sources.contract import Motion
from dbbstation.sources.of_struts import of_struts
from dbbstation.sources.registry import known_sources
from dbbstation.sources.trial import trial_machine
from dbbstation.trace.drive import DriveRecording

PRESLIDING, LOST_MOTION, TIME_SKEW, DRIFT = (
    known_drive_sources()[name] for name in ("presliding", "lost-motion", "time-skew", "friction-drift")
)
LENGTH_MM, WIDTH_MM = 0.8, 0.5
T = np.linspace(0.0, 12.0, 3001)
X = 20.0 * np.sin(T)  # strokes of 25 lengths wind it up wholly; the turning points are no rows
FINE = 60


def bristles(travel):
    """Friction over Coulomb friction at each row: dz = (s - z) |dx| / l in small steps, wound up at the start [Dahl 1968]."""
    fine = np.interp(np.arange((len(travel) - 1) * FINE + 1) / FINE, np.arange(len(travel)), travel)
    z, found = float(np.sign(travel[1] - travel[0])), []
    for k, step in enumerate(np.diff(fine).tolist()):
        if k % FINE == 0:
            found.append(z)
        z += ((step > 0.0) - (step < 0.0) - z) * abs(step) / LENGTH_MM
    return np.array([*found, z])


def pushed(travel, width, begins=0.0):
    """Place of a thing in a gap, which moves only where a side of the gap takes it along."""
    lies, found = travel[0] + begins, []
    for x in travel:
        lies = min(max(lies, x - 0.5 * width), x + 0.5 * width)
        found.append(lies)
    return np.array(found)


def since_reversal(travel, rows=T):
    """Direction and travel since the last turning point of 20 sin t, from its formula."""
    turned = np.floor(rows / np.pi - 0.5)
    return np.sign(np.cos(rows)), np.where(turned < 0.0, np.inf, np.abs(travel - 20.0 * (-1.0) ** turned))


def strut_motion():
    machine = trial_machine()
    poses = np.zeros((len(T), 6))
    poses[:, 0], poses[:, 2] = 2.0 * X, -1000.0
    motion = Motion(poses, is_path=True, time_s=T)
    return machine, motion, motion.struts(machine).length_mm


def signals():
    return signals_of(DriveRecording("strokes", T, X, np.cos(T)), 10.0)


def presliding_of_struts():
    machine, motion, lengths = strut_motion()
    values = np.append(np.full(6, 1000.0), LENGTH_MM)  # 1 mm
    effect = of_struts(type(PRESLIDING))().effect(motion, machine, values).strut_mm
    way = np.sign(np.diff(lengths, axis=0, prepend=2.0 * lengths[:1] - lengths[1:2]))
    return [(way[:, k] + effect[:, k], bristles(lengths[:, k])) for k in range(6)]


def presliding_of_a_drive():
    (form,) = PRESLIDING.forms(Scale())
    recorded = signals()
    moving = recorded.direction != 0.0
    found = recorded.direction + force(PRESLIDING, form, (LENGTH_MM,))(recorded)[:, 0]
    return [(found[moving], bristles(X)[moving])]


def presliding_of_a_table():
    way, since = since_reversal(X)
    columns = {"direction": way, "since_reversal_mm": since}
    clock = Variable("t_s", "s", Kind.TIME, T)
    table = Table(way, 0.0 * way, "N", "zero", (clock,), {}, columns, (slice(0, len(T)),), ("run",), clock)
    law = next(law for law in table.channel([PRESLIDING]).laws if law.name == "presliding")
    return [(way + law.columns((LENGTH_MM,))[:, 0], bristles(X))]


def presliding_at_a_port():
    term = Term("force", TermForm.OWN, (), (1.0,), (LENGTH_MM,), own=PRESLIDING)
    value, signals = evaluator(term), zip(*since_reversal(X), strict=True)
    found = [
        way + value(t, {"direction": way, "since_reversal_mm": since})
        for t, (way, since) in zip(T, signals, strict=True)
    ]
    return [(np.array(found), bristles(X))]


@pytest.mark.parametrize(
    "client", [presliding_of_struts, presliding_of_a_drive, presliding_of_a_table, presliding_at_a_port]
)
def test_presliding_is_that_of_bristles(client):
    for found, expected in client():
        # Where a strut turns round within a row, this row may belong to either direction.
        assert np.mean(np.abs(found - expected) > 1e-3) < 2e-3
        assert np.ptp(found) == pytest.approx(2.0, abs=1e-3)


def play_of_struts():
    machine, motion, lengths = strut_motion()
    lag = known_sources()["backlash"].effect(motion, machine, np.full(6, 1e3 * WIDTH_MM)).strut_mm
    begins = -0.5 * WIDTH_MM * np.sign(lengths[1] - lengths[0])
    return [(lag[:, k], pushed(lengths[:, k], WIDTH_MM, begins[k]) - lengths[:, k]) for k in range(6)]


def play_of_a_drive():
    (form,) = LOST_MOTION.forms(Scale())
    missing = force(LOST_MOTION, form, (WIDTH_MM, 1e-6))(recorded := signals())[:, 0]
    lies = pushed(X, WIDTH_MM, -0.5 * WIDTH_MM)
    stands = np.append(False, np.diff(lies) == 0.0)  # a thing that stands has no friction
    moving = recorded.direction != 0.0
    return [(missing[moving], -(recorded.direction * stands)[moving])]


def play_of_a_table():
    place = Variable("x", "mm", Kind.LENGTH, X)
    found = next(p for p in patterns([place], [slice(0, len(T))], T, None) if p.family is Family.HYSTERESIS)
    widths = [share * place.extent for share in (0.003, 0.01, 0.03, 0.1)]
    return [(found.samples[:, 3 + k], 2.0 * (X - pushed(X, width)) / width) for k, width in enumerate(widths)]


def play_at_a_port():
    value = evaluator(Term("path", TermForm.PLAY, ("x",), (0.5 * WIDTH_MM,)))
    return [(np.array([value(t, {"x": x}) for t, x in zip(T, X, strict=True)]), pushed(X, WIDTH_MM) - X)]


@pytest.mark.parametrize("client", [play_of_struts, play_of_a_drive, play_of_a_table, play_at_a_port])
def test_play_is_that_of_a_thing_in_a_gap(client):
    for found, expected in client():
        assert found == pytest.approx(expected, abs=1e-12)
        assert np.ptp(found) > 0.0


LATE_S = 0.03


def struts_at(machine, t):
    poses = np.zeros((len(t), 6))
    poses[:, 0], poses[:, 2] = 40.0 * np.sin(t), -1000.0
    return Motion(poses, is_path=True, time_s=t).struts(machine).length_mm


def delay_of_struts():
    machine, motion, lengths = strut_motion()
    found = known_sources()["time-skew"].effect(motion, machine, np.array([1e3 * LATE_S])).strut_mm
    return found[:-20], (struts_at(machine, T + LATE_S) - lengths)[:-20]  # of the last rows the spline knows no more


def delay_of_a_drive():
    (form,) = TIME_SKEW.forms(Scale())
    recorded = signals()
    # The force is cos t; to first order it comes late by d times its rate.
    return 1e3 * force(TIME_SKEW, form)(recorded)[1:-1, 0], np.sin(recorded.t_s)[1:-1]


def delay_of_a_table():
    law = memory_laws(LawRows(T, "s", (slice(0, len(T)),), 1.0, "mm"), [Variable("x", "mm", Kind.LENGTH, X)])[1]
    late = T > LATE_S
    return law.columns((LATE_S,))[late, 1], (20.0 * np.sin(T - LATE_S) - X)[late]


def delay_at_a_port():
    value = evaluator(Term("path", TermForm.DELAY, ("x",), (LATE_S,)))
    found = np.array([value(t, {"x": x}) for t, x in zip(T, X, strict=True)])
    late = T > LATE_S
    return found[late], (20.0 * np.sin(T - LATE_S) - X)[late]


@pytest.mark.parametrize("client", [delay_of_struts, delay_of_a_drive, delay_of_a_table, delay_at_a_port])
def test_a_delay_is_what_was_before(client):
    found, expected = client()
    assert found == pytest.approx(expected, abs=1e-4)
    assert np.ptp(found) > 0.5


def behind(values, t, constant, begins):
    """What follows values with one time constant, less them: midpoint steps of tau dy/dt = x - y between straight rows."""
    y, found = values[0] + begins, [begins]
    for k in range(1, len(t)):
        h = (t[k] - t[k - 1]) / FINE
        for x in np.linspace(values[k - 1], values[k], FINE, endpoint=False) + (values[k] - values[k - 1]) / FINE / 2.0:
            y = y + h * (x - y) / (constant + 0.5 * h)
        found.append(y - values[k])
    return np.array(found)


def lag_of_struts():
    machine, motion, lengths = strut_motion()
    found = known_sources()["servo-lag"].effect(motion, machine, np.full(6, 1e3 * LATE_S)).strut_mm
    speed, step = np.gradient(lengths[:, 0], T, edge_order=2), T[1] - T[0]
    # It begins as a loop does that has forgotten how it began.
    begins = -LATE_S * speed[0] + LATE_S**2 * (speed[1] - speed[0]) / step
    return found[:, 0], behind(lengths[:, 0], T, LATE_S, begins)


def lag_of_a_drive():
    form = DRIFT.forms(Scale())[0]
    recorded = signals()
    moving = recorded.direction != 0.0
    found = force(DRIFT, form, (2.0,))(recorded)[:, 0] * recorded.direction
    since = recorded.t_s - recorded.t_s[0]
    step = 1.0 + behind(np.ones(len(since)), since, 2.0, -1.0)  # what a step heats
    return found[moving], (step / step[-1] - np.mean(step / step[-1]))[moving]


def lag_of_a_table():
    law = memory_laws(LawRows(T, "s", (slice(0, len(T)),), 1.0, "mm"), [Variable("x", "mm", Kind.LENGTH, X)])[0]
    return law.columns((LATE_S,))[:, 1], behind(X, T, LATE_S, 0.0)


def lag_at_a_port():
    value = evaluator(Term("path", TermForm.LAG, ("x",), (LATE_S,)))
    return np.array([value(t, {"x": x}) for t, x in zip(T, X, strict=True)]), behind(X, T, LATE_S, 0.0)


@pytest.mark.parametrize("client", [lag_of_struts, lag_of_a_drive, lag_of_a_table, lag_at_a_port])
def test_a_lag_follows_with_one_time_constant(client):
    found, expected = client()
    assert found == pytest.approx(expected, abs=1e-4)  # speeds of struts are differences
    assert np.ptp(found) > 0.5
