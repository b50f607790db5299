"""Events folded into what is drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import InstrumentError
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.plan.plan import Direction, Plan
from dbbstation.service.board import Board, Mark, RunDecision, SequenceOpened, Weight
from dbbstation.service.live_trace import LiveTrace, View, difference
from dbbstation.station import events
from dbbstation.station.commands import Accept, Judge, Quit, Reject, Repeat, Skip, Start
from dbbstation.station.judging import JudgedRun
from dbbstation.station.states import State
from dbbstation.tui.measure_screen import FiguresPanel
from dbbstation.tui.reading_panel import ReadingPanel
from dbbstation.tui.sentences import now
from dbbstation.tui.set_up_panel import SetUpPanel
from tests.tui.happenings import Happening, make_plan


def test_what_comes_first_is_a_set_up() -> None:
    board = Happening().board()
    assert board.state is State.ANNOUNCED
    assert Start in board.allowed
    assert board.marks == [Mark.NEXT, *[Mark.OPEN] * 5]
    assert (
        now(board) == "Put the short holder with the ball 9-short into bore 9, tilt and bar as shown; then press Enter."
    )


def test_the_trace_holds_the_full_turn_and_nothing_else() -> None:
    happening = Happening().circle("t0", Direction.CCW)
    trace = happening.board().traces[Direction.CCW]
    turn_s = 360.0 / trace.circle.turning_deg_s
    assert len(trace) == pytest.approx(20.0 * turn_s, abs=3)
    assert trace.theta_deg.min() == pytest.approx(30.0, abs=1.5)
    assert trace.theta_deg.max() == pytest.approx(390.0, abs=1.5)
    assert np.isfinite(trace.deviation_um).all()
    assert trace.largest_um == pytest.approx(np.abs(trace.deviation_um).max())


@pytest.mark.parametrize("overshoot_deg", [0.0, 20.0])
def test_feeding_in_and_out_does_not_spoil_the_scale(overshoot_deg: float) -> None:
    happening = Happening(make_plan(overshoot_deg=overshoot_deg)).circle("t0", Direction.CCW)
    assert happening.board().traces[Direction.CCW].largest_um < 40.0


def test_samples_without_a_length_and_lost_ones_break_the_line() -> None:
    happening = Happening().circle("t0", Direction.CCW, 0.4)
    board = happening.board()
    trace = board.traces[Direction.CCW]
    before = len(trace)
    run = trace.run
    samples = (
        events.Sample(5.0, 150.0, phi_deg=100.0),
        events.Sample(5.1, 150.0, "fault", "no signal", phi_deg=101.0),
        events.Sample(5.2, 150.0, lost=3, phi_deg=105.0),
        events.Sample(5.3, 250.0, phi_deg=106.0),
    )
    board.take(events.SamplesRecorded(run, samples))
    assert np.isnan(trace.deviation_um[before:]).tolist() == [False, True, True, False, True]
    assert board.lost == 3


def test_directions_of_a_test_stay_beside_each_other_another_test_begins_anew() -> None:
    happening = Happening().circle("t0", Direction.CCW).command(Accept()).circle("t0", Direction.CW, 0.5)
    assert set(happening.board().traces) == {Direction.CCW, Direction.CW}
    assert happening.board().running is Direction.CW
    happening = Happening().circle("t0", Direction.CCW).command(Accept(), Skip()).circle("t1", Direction.CCW, 0.5)
    assert [trace.run.test for trace in happening.board().traces.values()] == ["t1"]


def test_marks_follow_the_verdicts() -> None:
    happening = Happening().circle("t0", Direction.CCW, 0.5)
    assert happening.board().marks[0] is Mark.RUNNING
    happening = Happening().circle("t0", Direction.CCW)
    assert happening.board().marks[0] is Mark.COMPLETE
    happening.command(Repeat())
    assert happening.board().marks[:2] == [Mark.NEXT, Mark.OPEN]
    happening.circle("t0", Direction.CCW).command(Accept())
    assert happening.board().marks[:2] == [Mark.ACCEPTED, Mark.NEXT]
    happening.circle("t0", Direction.CW).command(Reject())
    assert happening.board().marks[:3] == [Mark.ACCEPTED, Mark.PASSED, Mark.NEXT]
    happening.command(Skip(), Skip(), Skip(), Skip())
    board = happening.board()
    assert board.accepted == 1
    assert now(board) == (
        "The plan is through, 1 of 6 runs accepted; without an accepted run: t0 cw, t1 ccw, t1 cw, t2 ccw, t2 cw. "
        "E works on the results, Q leaves."
    )


def test_a_session_that_goes_on_shows_what_it_has() -> None:
    happening = Happening()
    board = happening.board()
    board.take(SequenceOpened(happening.schedule.tasks, happening.schedule.tasks[2:], "session-7"))
    assert board.marks[:3] == [Mark.ACCEPTED, Mark.ACCEPTED, Mark.OPEN]


def test_figures_of_a_finished_run_and_the_error_of_one_without_a_circle() -> None:
    board = Happening().circle("t0", Direction.CCW).board()
    assert board.results[0].figures is not None
    assert board.results[0].figures.centre_deviation_um == pytest.approx(20.0, abs=0.5)
    happening = Happening()
    happening.circle("t0", Direction.CCW, 0.5)
    late = happening.sequencer.readings([])
    assert late == []
    board = happening.board()
    run = board.traces[Direction.CCW].run
    board.take(events.RunCompleted(run, 90, 0, None, "t0-ccw-1: no feed-out found; is it closed?"))
    board.take(events.StateChanged(State.FLAWED, frozenset({Repeat, Reject, Quit})))
    assert board.marks[0] is Mark.FLAWED
    assert (
        now(board)
        == "REPEAT  t0-ccw-1 has no usable circle: no feed-out found; is it closed? Enter or R measures it again, X leaves it out."
    )
    assert board.messages[-1].weight is Weight.WARNING


def test_a_fault_says_what_where_and_what_helps() -> None:
    happening = Happening().circle("t0", Direction.CCW, 0.5)
    error = InstrumentError("the line was closed", where="/dev/ttyUSB0", remedy="plug it in again")
    happening.events += happening.sequencer.fail(error)
    board = happening.board()
    assert now(board) == (
        "FAULT at /dev/ttyUSB0: the line was closed. What helps: plug it in again. t0-ccw-1 is kept as far as it came. "
        "Then C connects again, Q leaves."
    )
    assert board.marks[0] is Mark.OPEN
    board.take(SequenceOpened(happening.schedule.tasks, happening.schedule.open, "session-7"))
    assert board.fault is None


def test_the_rate_is_counted_in_the_time_of_the_samples() -> None:
    happening = Happening().circle("t0", Direction.CCW, 0.5)
    board = happening.board()
    assert board.rate.per_s == pytest.approx(20.0, rel=0.05)
    # Behind the run samples have the instrument's clock again, ahead of it others.
    for start_s in (1000.0, 0.0):
        for second in range(4):
            board.take(events.ReadingsSeen((events.Sample(start_s + second, 150.0),)))
        assert board.rate.per_s == pytest.approx(1.0)
    board.rate.forget()
    assert board.rate.per_s is None


def test_a_refused_command_is_told() -> None:
    board = Happening().command(Accept()).board()
    assert "`accept` means nothing while waiting for the set-up" in board.messages[-1].text


def test_the_place_of_a_ball_under_the_spindle_is_where_the_machine_stands() -> None:
    plan = read_plan(shipped_folder("protocols") / "plans" / "conventional.yaml")
    board = Happening(Plan(plan.name, {"g": plan.tests["g"]})).board()
    assert now(board).startswith(
        "Drive the machine to X -100.000 Y 0.000 Z -1008.000 A 0° B -15° and put the ball g up"
    )
    rows = SetUpPanel().text(board).plain.splitlines()
    assert rows[:3] == ["under spindle put up", "at X -100 Y 0 Z -1008", "ball g"]


def test_a_rejected_run_is_marked_and_its_trace_goes() -> None:
    board = Happening().circle("t0", Direction.CCW).command(Reject()).board()
    assert board.verdicts == {"t0-ccw-1": RunDecision.REJECTED}
    assert board.traces == {}
    (row,) = FiguresPanel().text(board).plain.splitlines()[1:]
    assert row.startswith("x ")


def test_a_complete_circle_is_seen_about_its_own_centre() -> None:
    trace = Happening().circle("t0", Direction.CCW).board().traces[Direction.CCW]
    assert trace.centred is not None
    # An ellipse of 12 µm is left where an offset of 20 µm was; live angles are good to some degrees.
    assert trace.centred.largest_um == pytest.approx(12.0, abs=1.0)
    assert trace.largest_um == pytest.approx(30.0, abs=3.0)
    assert len(trace.centred) == len(trace)


def test_what_is_over_is_not_red_any_more() -> None:
    happening = Happening().circle("t0", Direction.CCW, 0.5)
    happening.events += happening.sequencer.fail(InstrumentError("the line was closed"))
    board = happening.board()
    assert board.messages[-1].weight is Weight.FAULT
    board.take(SequenceOpened(happening.schedule.tasks, happening.schedule.open, "session-7"))
    assert {message.weight for message in board.messages} == {Weight.NOTE}


def test_no_bar_is_no_fault_before_a_run() -> None:
    board = Happening().board()
    board.take(events.ReadingsSeen((events.Sample(0.0, None, "fault", "signal lost"),)))
    panel = ReadingPanel(clock=lambda: 0.0)
    assert panel.text(board).plain.splitlines()[1] == "no bar: signal lost"
    board.take(events.StateChanged(State.ARMED, frozenset()))
    assert panel.text(board).plain.splitlines()[1] == "FAULT signal lost"


def test_a_verdict_that_is_taken_back_opens_its_task() -> None:
    happening = Happening().circle("t0", Direction.CCW).command(Accept()).circle("t0", Direction.CW).command(Accept())
    assert happening.board().marks[:2] == [Mark.ACCEPTED, Mark.ACCEPTED]
    happening.command(Judge("t0", Direction.CCW, 1, accepted=False, reason="a bump"))
    board = happening.board()
    assert board.marks[:3] == [Mark.OPEN, Mark.ACCEPTED, Mark.NEXT]
    assert "t0-ccw-1 does not count" in board.messages[-1].text
    happening.command(Judge("t0", Direction.CCW, 1, accepted=True))
    assert happening.board().marks[:3] == [Mark.ACCEPTED, Mark.ACCEPTED, Mark.NEXT]


def test_runs_of_earlier_sittings_are_known_rejected_ones_too() -> None:
    happening = Happening().circle("t0", Direction.CCW)
    (completed,) = happening.board().runs.values()
    figures = completed.figures
    assert figures is not None
    later = replace(
        completed,
        run=replace(completed.run, repeat=2),
        figures=replace(figures, circularity_um=figures.circularity_um + 1),
    )
    board = Board()
    known = (JudgedRun(later, accepted=False, reason="a chip"), JudgedRun(completed, accepted=True))
    board.take(SequenceOpened(happening.schedule.tasks, (), "session-7", known))
    assert board.runs_of("t0", Direction.CCW) == (completed, later)
    assert board.runs_of("t0", Direction.CW) == ()
    assert (board.verdicts["t0-ccw-2"], board.reasons["t0-ccw-2"]) == (RunDecision.REJECTED, "a chip")
    # The figures of a test are those of its last run that may count.
    assert board.figures_of("t0", Direction.CCW) == figures
    board.take(events.RunAccepted(later.run))
    assert board.figures_of("t0", Direction.CCW) == later.figures


def test_the_difference_of_both_directions_is_the_form_that_one_has_more() -> None:
    traces = []
    for direction in (Direction.CCW, Direction.CW):
        circle = make_plan().tests["t0"].run(direction)
        trace = LiveTrace(events.RunId("t0", direction, 1, 1), circle)
        phi_deg = np.arange(0.25, 360.0, 0.5)
        theta = np.radians(circle.theta_deg(phi_deg))
        more_um = 5.0 * np.cos(3.0 * theta) if direction is Direction.CW else 0.0
        length_mm = circle.bar_mm + (12.0 * np.cos(2.0 * theta) + 0.1 * np.cos(theta) + more_um) / 1e3
        trace.add(
            [
                events.Sample(k / 10, float(one), phi_deg=float(phi))
                for k, (phi, one) in enumerate(zip(phi_deg, length_mm, strict=True))
            ]
        )
        trace.centre()
        assert trace.centred is not None
        traces.append(trace.centred)
    shown = difference(*traces)
    assert shown is not None
    # A straight line over half a degree of three lobes is off by 5 µm · (3 · 0.5°)² / 8 = 0.4 nm.
    np.testing.assert_allclose(shown.deviation_um, -5.0 * np.cos(3.0 * np.radians(shown.theta_deg)), atol=2e-3)
    assert shown.largest_um == pytest.approx(5.0, abs=2e-3)


def test_the_difference_is_there_as_long_as_both_circles_count() -> None:
    happening = Happening().circle("t0", Direction.CCW)
    assert set(happening.board().views) == {View.MEASURED, View.CENTRED}
    happening.command(Accept()).circle("t0", Direction.CW, share=0.5)
    assert set(happening.board().views) == {View.MEASURED}
    happening = Happening().circle("t0", Direction.CCW).command(Accept()).circle("t0", Direction.CW)
    assert set(happening.board().views) == set(View)
    happening.command(Reject())
    assert View.DIFFERENCE not in happening.board().views
