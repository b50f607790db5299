"""The sequencer turns commands and readings into events; it uses no port, file, clock or thread."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.instrument.reading import DOUBTFUL, OK
from dbbstation.plan.sampling import sampled
from dbbstation.quality.finding import against_limit
from dbbstation.quality.held import HeldLength
from dbbstation.station import events
from dbbstation.station.commands import (
    Accept,
    AddNote,
    Command,
    GoTo,
    Judge,
    Pause,
    Reject,
    Repeat,
    Resume,
    Skip,
    Start,
)
from dbbstation.station.detector import CircleWatch, EdgeDetector, Patience
from dbbstation.station.run_record import RunRecord, circle_figures, unrecorded
from dbbstation.station.states import (
    COMMAND_CAUSES,
    FINAL,
    RECORDING,
    TRANSITIONS,
    VERDICT,
    State,
    Trigger,
    commands_allowed,
)
from dbbstation.trace.cut import COUNTS_BACKWARDS
from dbbstation.trace.reachable import Reachable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from dbbstation.errors import StationError
    from dbbstation.instrument.reading import Reading
    from dbbstation.plan.plan import Ball, Circle, Direction, Plan
    from dbbstation.plan.sampling import SampledCircle
    from dbbstation.quality.finding import Finding
    from dbbstation.station.events import Event, RunId, Sample
    from dbbstation.station.schedule import Schedule
    from dbbstation.trace.analysis import CircleFigures
    from dbbstation.trace.recording import Recording


def instructions(
    ball: Ball, circle: Circle, *, put_up: bool, program: str, sampling: SampledCircle | None = None
) -> tuple[str, ...]:
    """Return the steps in order, with a note if the instrument is too slow."""
    raised = f", raised by {circle.elevation_deg:g}°" if circle.elevation_deg else ", level"
    what = f"NC program {program}" if program else f"{circle.direction} circle"
    return (
        *(_mounted if ball.place_known else _under_spindle)(ball, circle, put_up=put_up),
        f"Bar of {circle.bar_mm:g} mm{raised}; circle about {_place(circle.centre_mm)}",
        f"Start the {what} at {circle.feed_mm_min:g} mm/min",
        *(() if sampling is None or sampling.enough else (too_slow(sampling),)),
    )


def too_slow(sampling: SampledCircle) -> str:
    """Return the figures that are not resolved by so few points."""
    points = f"The instrument brings {sampling.points_per_turn:.0f} points per turn"
    if not sampling.is_circle:
        return f"{points}, which is no circle: take a lower feed"
    return f"{points}: undulations above {sampling.highest_undulation} per revolution are not seen"


def _mounted(ball: Ball, circle: Circle, *, put_up: bool) -> tuple[str, ...]:
    step = _mount(ball) if put_up else f"Leave the ball {ball.name} where it stands, do not touch its holder"
    return (step, _tilt(circle))


def _under_spindle(ball: Ball, circle: Circle, *, put_up: bool) -> tuple[str, ...]:
    """Return the steps of the standard circular test [CAL III-A], beginning with the move to the circle's centre and tilt."""
    if not put_up:
        return (f"Leave the ball {ball.name} and the moving ball as they stand, do not touch them", _tilt(circle))
    return (
        f"Drive the machine to {_place(ball.centre_mm)} {tilt_words(circle)} and put the ball {ball.name} up under the spindle",
        "With a micrometer: read now how far both balls are from the tool tip, and note it for the session file",
    )


def tilt_words(circle: Circle) -> str:
    """Return the tool's tilt; C only if it is not zero."""
    a, b, c = circle.tilt_deg
    return f"A {a:g}° B {b:g}°" + (f" C {c:g}°" if c else "")


def _tilt(circle: Circle) -> str:
    a, b, c = circle.tilt_deg
    turn = f" and turn it C {c:g}°" if c else ""
    return f"Tilt the tool to A {a:g}°, B {b:g}°{turn}"


def _place(point_mm: tuple[float, float, float]) -> str:
    x, y, z = point_mm
    return f"X {x:.3f} Y {y:.3f} Z {z:.3f}"


def _mount(ball: Ball) -> str:
    if ball.bore is None:
        return f"Set up the ball {ball.name} ({ball.holder}); it stands in no bore"
    return f"Put the {ball.holder} holder with the ball {ball.name} into bore {ball.bore}"


@dataclass(frozen=True)
class Waiting:
    """A recorded run without verdict."""

    completed: events.RunCompleted
    samples: tuple[Sample, ...]


FEEDING_DEG = 10.0
"""Angle at either end of the turn that may belong to feed-in or feed-out if there is no overshoot [deg]."""

LOOK_AFTER_LINE = "look after bar, balls and cable"
"""Advice about an impossible reading."""


class Sequencer:
    """Runs a plan by the table of states in `states.py`.

    Args:
        recorded: returns the recording of the current run; it raises StationError if it cannot be read.
        waiting: recorded runs without verdict, oldest first; judged before measuring.
        doubted: accepted runs that the run just judged puts in doubt.
    """

    def __init__(
        self,
        plan: Plan,
        schedule: Schedule,
        recorded: Callable[[RunId, Sequence[Sample]], Recording],
        *,
        programs: Mapping[tuple[str, Direction], str] | None = None,
        patience: Patience | None = None,
        waiting: Sequence[Waiting] = (),
        judge: Callable[[RunId, Recording], tuple[Finding, ...]] | None = None,
        doubted: Callable[[], Mapping[RunId, Finding]] = dict,
        rate_hz: float | None = None,
    ) -> None:
        self.state = State.BETWEEN
        self.plan = plan
        self.schedule = schedule
        self._recorded = recorded
        self._judge_run, self._look_back = judge, doubted
        self._doubted: Mapping[RunId, Finding] = {}
        self._programs = programs or {}
        self._patience = patience or Patience()
        self._rate_hz = rate_hz
        self._out: list[Event] = []
        self._samples: list[Sample] = []
        self._run: RunId | None = None
        self._commanded: Circle | None = None
        self._record: RunRecord | None = None
        self._edges: EdgeDetector | None = None
        self._watch: CircleWatch | None = None
        self._reachable: Reachable | None = None
        self._remounted = False
        self._after_s = -math.inf
        self._held = HeldLength()
        self._unjudged = deque(waiting)
        self._waiting_since_s: float | None = None
        self._told_deg = 0.0
        self._wrong = ""

    def begin(self) -> list[Event]:
        """Announce the first run, or one that awaits its verdict."""
        self._announce_next()
        return self._told()

    def command(self, command: Command) -> list[Event]:
        """Execute a command, or refuse it in this state."""
        cause = COMMAND_CAUSES[type(command)]
        if cause not in TRANSITIONS[self.state]:
            self._out.append(events.CommandRefused(self._why_not(cause)))
            return self._told()
        match command:
            case Start():
                self._arm(command)
            case Accept():
                self._accept(command)
            case Repeat() | Reject():
                self._throw_out(command)
            case Skip():
                self.schedule.pass_over(self._announced())
                self._to_next(cause)
            case GoTo() | Judge():
                self._reorder(command)
            case AddNote():
                self._flush()
                self._out.append(events.Noted(command.text, command.ambient_temp_c))
            case Pause():
                self._edges = self._watch = None
                self._move(cause)
            case Resume():
                self._to_next(cause)
            case _:
                self._stop()
        return self._told()

    def readings(self, readings: Iterable[Reading]) -> list[Event]:
        """Process readings in time order."""
        for reading in readings:
            if self.state in FINAL:
                break
            self._take(reading)
        return self._told()

    def fail(self, error: StationError) -> list[Event]:
        """End the sequence because instrument or storage failed."""
        if self.state in FINAL:
            return []
        self._flush()
        self._out.append(events.Fault(error, self._interrupted()))
        self._move(Trigger.FAILED)
        return self._told()

    # Between runs.

    def _announce_next(self) -> None:
        self._edges = None
        if self._unjudged:
            self._offer(self._unjudged.popleft())
            return
        following = self.schedule.next()
        if following is None:
            missing = tuple(task.text for task in self.schedule.open)
            self._out.append(events.SessionFinished(self.schedule.accepted, missing))
            self._move(Trigger.NONE_LEFT)
            return
        self._announce(following.run, following.number, put_up=following.put_up)
        self._watch = CircleWatch(self._circle(), waits_for_feed_in=True)
        self._move(Trigger.RUN_LEFT)

    def _announce(self, run: RunId, number: int, *, put_up: bool) -> None:
        self._run = run
        test = self.plan.tests[run.test]
        program = self._programs.get((run.test, run.direction), "")
        self._commanded = circle = test.run(run.direction)
        self._reachable = Reachable(circle)
        seen = None if self._rate_hz is None else sampled(circle, self._rate_hz)
        announced = events.RunAnnounced(
            run=run,
            ball=test.ball,
            circle=circle,
            put_up=put_up,
            program=program,
            number=number,
            count=len(self.schedule.tasks),
            instructions=instructions(test.ball, circle, put_up=put_up, program=program, sampling=seen),
            sampling=seen,
        )
        self._out.append(announced)

    def _offer(self, waiting: Waiting) -> None:
        run = waiting.completed.run
        self._announce(run, self.schedule.number_of(run), put_up=False)
        self._out += [events.RunRestored(run, waiting.samples), waiting.completed]
        self._wrong = _found_wrong(waiting.completed)
        self._move(Trigger.CIRCLE_MISSING if waiting.completed.figures is None else Trigger.CIRCLE_FOUND)

    def _to_next(self, cause: Trigger) -> None:
        self._record = None
        self._move(cause)
        self._announce_next()

    # Commands.

    def _arm(self, command: Start) -> None:
        self._remounted, self._after_s = command.remounted, command.after_s
        self._edges = EdgeDetector(self._circle())
        self._watch = CircleWatch(self._circle(), waits_for_feed_in=False)
        self._waiting_since_s = None
        self._move(Trigger.START)

    def _accept(self, command: Accept) -> None:
        run = self._announced()
        beside = self.schedule.counts_beside(run)
        self.schedule.accept(run)
        reason = command.reason or (f"accepted although {self._wrong}" if self._wrong else "")
        self._out.append(events.RunAccepted(run, reason, None if command.alone else beside))
        if beside is not None and command.alone:
            self.schedule.judge(beside.test, beside.direction, beside.repeat, accepted=False)
            self._out.append(events.RunRejected(beside, f"{run.label} counts in its place"))
        self._take_back(command)
        self._to_next(Trigger.ACCEPT)

    def _throw_out(self, command: Repeat | Reject) -> None:
        run = self._announced()
        word = "repeated" if isinstance(command, Repeat) else "rejected"
        reason = command.reason or (self._wrong if self.state in VERDICT else "") or f"{word} by the operator"
        if self.state in RECORDING:
            self._complete(problem=reason)
        if self.state is not State.ARMED:
            self._out.append(events.RunRejected(run, reason))
        if isinstance(command, Reject):
            self.schedule.pass_over(run)
        else:
            self._take_back(command)
        self._to_next(COMMAND_CAUSES[type(command)])

    def _take_back(self, command: Accept | Repeat) -> None:
        doubted = self._doubted if command.back else {}
        for run, finding in doubted.items():
            self.schedule.judge(run.test, run.direction, run.repeat, accepted=False)
            self._out.append(events.RunRejected(run, finding.text))
        for run in list(doubted)[:1]:
            self.schedule.go_to(run.test, run.direction)

    def _reorder(self, command: GoTo | Judge) -> None:
        try:
            if isinstance(command, GoTo):
                self.schedule.go_to(command.test, command.direction)
            else:
                self._judge(command)
        except KeyError as error:
            what = "the plan has no test" if isinstance(command, GoTo) else "no complete recording is called"
            self._out.append(events.CommandRefused(f"{what} {error.args[0]}"))
            return
        self._to_next(COMMAND_CAUSES[type(command)])

    def _judge(self, command: Judge) -> None:
        # The mounting of a run that was recorded long ago is not needed to judge it.
        run = events.RunId(command.test, command.direction, command.repeat, 0)
        beside = self.schedule.counts_beside(run)
        self.schedule.judge(command.test, command.direction, command.repeat, accepted=command.accepted)
        verdict = events.RunAccepted(run, command.reason, beside) if command.accepted else None
        self._out.append(verdict or events.RunRejected(run, command.reason))

    def _stop(self) -> None:
        self._flush()
        left = len(self.schedule.open)
        self._out.append(events.SessionStopped(self.schedule.accepted, left, self._interrupted()))
        self._move(Trigger.QUIT)

    def _why_not(self, cause: Trigger) -> str:
        possible = ", ".join(sorted(COMMAND_CAUSES[kind] for kind in commands_allowed(self.state)))
        return f"`{cause}` means nothing while {self.state}; possible: {possible or 'nothing any more'}"

    # Readings.

    def _take(self, reading: Reading) -> None:
        reading = self._held_against_feed(reading)
        outside = None
        new = self.state is not State.ARMED or reading.t_s > self._after_s
        if new and self._edges is not None and reading.length_mm is not None and reading.status == OK:
            outside = self._edges.outside(reading.length_mm)
        if self._waiting_since_s is None:
            self._waiting_since_s = reading.t_s
        if self.state is State.ARMED and outside is True:
            self._begin_run(reading)
        if self.state not in RECORDING or self._record is None:
            self._samples.append(unrecorded(reading))
            self._look_for_missed(reading)
            self._check_patience(reading)
            return
        sample = self._record.add(reading)
        self._samples.append(sample)
        if self.state is State.DWELLING and outside is False:
            self._fed_in(self._record, sample.t_s, reading.t_s)
        elif self.state is State.TURNING and outside is True:
            self._flush()
            self._record.fed_out_s = sample.t_s
            self._move(Trigger.FED_OUT)
        elif self.state is State.LEAVING and self._record.left(sample.t_s):
            self._move(Trigger.CIRCLE_FOUND if self._complete() else Trigger.CIRCLE_MISSING)
        elif self.state is State.TURNING and self._record.stands(sample):
            self._complete(problem=self._record.standing)
            self._move(Trigger.LENGTH_GONE)
        elif reading.gone and sample.phi_deg is not None and 0.0 <= sample.phi_deg <= FULL_TURN_DEG:
            self._complete(problem=_length_gone(reading, sample.phi_deg))
            self._move(Trigger.LENGTH_GONE)
        else:
            self._check_patience(reading)
        self._tell_progress()

    def _held_against_feed(self, reading: Reading) -> Reading:
        """Return a reading, marked as doubtful if the machine cannot move the bar so fast."""
        if self._reachable is None or reading.length_mm is None or reading.status != OK:
            return reading
        if self.state not in RECORDING or self._record is None:
            # The bar is put in by hand, and the machine comes at any feed.
            self._reachable.note(reading.t_s, reading.length_mm, reading.t_uncertainty_s or 0.0)
            return reading
        phi_deg = self._record.phi_deg(reading.t_s - self._record.started_s)
        # Live angles are good to a degree or two, and at either end of the turn the machine may feed.
        on_turn = phi_deg is not None and FEEDING_DEG <= phi_deg <= FULL_TURN_DEG - FEEDING_DEG
        why = self._reachable.doubt(reading.t_s, reading.length_mm, reading.t_uncertainty_s or 0.0, on_turn=on_turn)
        return replace(reading, status=DOUBTFUL, said=why, remedy=LOOK_AFTER_LINE) if why else reading

    def _begin_run(self, reading: Reading) -> None:
        # Only now is it certain that a ball stands: a start that comes to nothing leaves no mounting.
        self._run = run = self.schedule.mounted(self._announced(), remounted=self._remounted)
        self._flush()
        self._held.restart()
        self._record = RunRecord(run, self._circle(), reading.t_s, held=self._held)
        self._waiting_since_s = reading.t_s
        self._out.append(events.RunStarted(run, self._programs.get((run.test, run.direction), "")))
        self._move(Trigger.BAR_OUTSIDE)

    def _fed_in(self, record: RunRecord, t_s: float, now_s: float) -> None:
        self._flush()
        record.fed_in_s = t_s
        self._waiting_since_s, self._told_deg = now_s, 0.0
        self._out.append(events.FeedInSeen(record.run))
        self._move(Trigger.FED_IN)

    def _tell_progress(self) -> None:
        if self.state is not State.TURNING or self._record is None:
            return
        swept = self._record.swept_deg()
        if swept >= self._told_deg + 1.0:
            self._told_deg = swept
            self._flush()
            self._out.append(events.RunProgress(self._record.run, swept, self._record.circle.swept_deg))

    def _look_for_missed(self, reading: Reading) -> None:
        if self._watch is None or reading.length_mm is None or reading.status != OK:
            return
        if not self._watch.seen(reading.t_s, reading.length_mm):
            return
        what = "before Start" if self.state is State.ANNOUNCED else "before the bar was seen at the feed-in point"
        problem = (
            f"the machine went onto the circle {what}: this circle is not recorded; let it end, send the machine to the "
            "feed-in point and run the program again"
        )
        if self._watch.backwards:
            problem = f"the length grew where the machine fed in: {COUNTS_BACKWARDS}; this circle is not recorded"
        self._flush()
        self._out.append(events.FeedInMissed(self._announced(), problem))

    def _check_patience(self, reading: Reading) -> None:
        if self.state not in {State.ARMED, State.DWELLING, State.TURNING} or self._waiting_since_s is None:
            return
        turning = self.state is State.TURNING
        limit_s = self._patience.for_turn_s(self._circle()) if turning else self._patience.for_machine_s
        if reading.t_s - self._waiting_since_s <= limit_s:
            return
        problem = f"no {'feed-out' if turning else 'feed-in'} seen within {limit_s:.0f} s; {_remedy(self._circle())}"
        if self.state is State.ARMED:
            self._flush()
            self._out.append(events.RunLate(self._announced(), problem))
            self._to_next(Trigger.LATE)
        else:
            self._complete(problem=problem)
            self._move(Trigger.LATE)

    def _complete(self, problem: str = "") -> bool:
        self._flush()
        record = self._record
        if record is None:
            raise RuntimeError(f"no run is recorded while {self.state}")
        found: CircleFigures | None = None
        findings: tuple[Finding, ...] = ()
        if not problem:
            recording = self._recorded(record.run, self._untold(record.run))
            lost, most_percent = (record.lost, record.lost_on_turn), self.plan.largest_loss_percent
            found, problem = circle_figures(recording, record.circle, *lost, most_percent)
            if found is not None and self._judge_run is not None:
                findings = self._judge_run(record.run, recording)
        completed = events.RunCompleted(
            record.run,
            record.samples,
            record.lost,
            found,
            problem,
            findings,
            record.doubtful,
            self.schedule.to_come(record.run),
            self.schedule.counts_beside(record.run),
        )
        self._out.append(completed)
        self._doubted = self._look_back() if findings else {}
        self._out += [events.RunDoubted(run, finding) for run, finding in self._doubted.items()]
        self._wrong = _found_wrong(completed)
        self.schedule.recorded(record.run)
        self._edges = None
        return found is not None

    # Small ones.

    def _announced(self) -> RunId:
        if self._run is None:
            raise RuntimeError(f"no run was announced while {self.state}")
        return self._run

    def _circle(self) -> Circle:
        if self._commanded is None:
            raise RuntimeError(f"no circle was announced while {self.state}")
        return self._commanded

    def _interrupted(self) -> RunId | None:
        return self._run if self.state in RECORDING else None

    def _move(self, cause: Trigger) -> None:
        self.state = TRANSITIONS[self.state][cause]
        self._out.append(events.StateChanged(self.state, commands_allowed(self.state)))

    def _flush(self) -> None:
        if not self._samples:
            return
        samples, self._samples = tuple(self._samples), []
        if self.state in RECORDING and self._record is not None:
            self._out.append(events.SamplesRecorded(self._record.run, samples))
        else:
            self._out.append(events.ReadingsSeen(samples))

    def _untold(self, run: RunId) -> list[Sample]:
        batches = (event for event in self._out if isinstance(event, events.SamplesRecorded) and event.run == run)
        return [sample for batch in batches for sample in batch.samples]

    def _told(self) -> list[Event]:
        self._flush()
        out, self._out = self._out, []
        return out


def _length_gone(reading: Reading, phi_deg: float) -> str:
    said = f" ({reading.said})" if reading.said else ""
    what = f"the instrument reports {reading.status}{said} at {phi_deg:.0f}° of the turn"
    return f"{what}; {reading.remedy or 'check bar and instrument'}, then repeat the run"


def _found_wrong(completed: events.RunCompleted) -> str:
    if completed.problem:
        return completed.problem
    return "; ".join(f"{one.name} wrong, {against_limit(one)}".removesuffix(", ") for one in completed.wrong)


def _remedy(circle: Circle) -> str:
    middle = circle.bar_mm + circle.feed_in_mm / 2.0
    return f"the length has to cross {middle:.3f} mm: check bar, circle and feed-in of the plan, then repeat"
