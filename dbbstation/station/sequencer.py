"""The sequencer: commands and readings in, events out. It knows no port, file, clock or thread."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.station import events
from dbbstation.station.commands import Accept, Command, Reject, Repeat, Skip, Start
from dbbstation.station.detector import EdgeDetector, Patience
from dbbstation.station.instructions import instructions
from dbbstation.station.run_record import RunRecord, unrecorded
from dbbstation.station.states import (
    COMMAND_CAUSES,
    FINAL,
    RECORDING,
    TRANSITIONS,
    Cause,
    State,
    commands_allowed,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from dbbstation.errors import StationError
    from dbbstation.instrument.reading import Reading
    from dbbstation.plan.circle import Circle, Direction
    from dbbstation.plan.plan import Plan
    from dbbstation.station.events import Event, RunId, Sample
    from dbbstation.station.run_record import Recorded
    from dbbstation.station.schedule import Schedule


class Sequencer:
    """Walks through a plan, run by run; every state change stands in the table of `states.py`.

    Time is that of the readings, so a recording played back, a scaled virtual machine and a test all look alike.
    Each method returns what happened, in order.

    Args:
        plan: what is measured.
        schedule: what is left of it.
        recorded: gives back the run that goes on, once it is complete.
        programs: name of the NC program that commands a test and direction; the plan's nominal circle where absent.
        patience: how long is waited for the machine.
    """

    def __init__(
        self,
        plan: Plan,
        schedule: Schedule,
        recorded: Recorded,
        *,
        programs: Mapping[tuple[str, Direction], str] | None = None,
        patience: Patience | None = None,
    ) -> None:
        self.state = State.BETWEEN
        self.plan = plan
        self.schedule = schedule
        self._recorded = recorded
        self._programs = programs or {}
        self._patience = patience or Patience()
        self._out: list[Event] = []
        self._samples: list[Sample] = []
        self._run: RunId | None = None
        self._commanded: Circle | None = None
        self._record: RunRecord | None = None
        self._edges: EdgeDetector | None = None
        self._waiting_since_s: float | None = None
        self._told_deg = 0.0

    def begin(self) -> list[Event]:
        """Announce the first run."""
        self._announce_next()
        return self._told()

    def command(self, command: Command) -> list[Event]:
        """Obey a command where the state takes it, refuse it otherwise."""
        cause = COMMAND_CAUSES[type(command)]
        if cause not in TRANSITIONS[self.state]:
            self._out.append(events.CommandRefused(command, self.state, self._why_not(cause)))
            return self._told()
        match command:
            case Start():
                self._arm(command)
            case Accept():
                self._accept()
            case Repeat() | Reject():
                self._throw_out(command)
            case Skip():
                self.schedule.pass_over()
                self._to_next(cause)
            case _:
                self._stop()
        return self._told()

    def readings(self, readings: Iterable[Reading]) -> list[Event]:
        """Take readings in time order."""
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
        self._move(Cause.FAILED)
        return self._told()

    # Between runs.

    def _announce_next(self) -> None:
        following = self.schedule.next()
        if following is None:
            missing = tuple(task.text for task in self.schedule.open)
            self._out.append(events.SessionFinished(self.schedule.accepted, missing))
            self._move(Cause.NONE_LEFT)
            return
        self._run = run = following.run
        test = self.plan.tests[run.test]
        program = self._programs.get((run.test, run.direction), "")
        self._commanded = circle = test.run(run.direction)
        announced = events.RunAnnounced(
            run=run,
            ball=test.ball,
            circle=circle,
            put_up=following.put_up,
            program=program,
            number=following.number,
            count=len(self.schedule.tasks),
            instructions=instructions(test.ball, circle, put_up=following.put_up, program=program),
        )
        self._out.append(announced)
        self._move(Cause.RUN_LEFT)

    def _to_next(self, cause: Cause) -> None:
        self._record = None
        self._move(cause)
        self._announce_next()

    # Commands.

    def _arm(self, command: Start) -> None:
        run = self._announced()
        self._run = self.schedule.mounted(run, remounted=command.remounted)
        self._edges = EdgeDetector(self._circle())
        self._waiting_since_s = None
        self._move(Cause.START)

    def _accept(self) -> None:
        run = self._announced()
        self.schedule.accept(run)
        self._out.append(events.RunAccepted(run))
        self._to_next(Cause.ACCEPT)

    def _throw_out(self, command: Repeat | Reject) -> None:
        run = self._announced()
        if self.state in RECORDING:
            self._complete(problem=command.reason)
        if self.state is not State.ARMED:
            self._out.append(events.RunRejected(run, command.reason))
        if isinstance(command, Reject):
            self.schedule.pass_over()
        self._to_next(COMMAND_CAUSES[type(command)])

    def _stop(self) -> None:
        self._flush()
        left = len(self.schedule.open)
        self._out.append(events.SessionStopped(self.schedule.accepted, left, self._interrupted()))
        self._move(Cause.QUIT)

    def _why_not(self, cause: Cause) -> str:
        possible = ", ".join(sorted(COMMAND_CAUSES[kind] for kind in commands_allowed(self.state)))
        return f"`{cause}` means nothing while {self.state}; possible: {possible or 'nothing any more'}"

    # Readings.

    def _take(self, reading: Reading) -> None:
        outside = None
        if self._edges is not None and reading.length_mm is not None and reading.status == "ok":
            outside = self._edges.outside(reading.length_mm)
        if self._waiting_since_s is None:
            self._waiting_since_s = reading.t_s
        if self.state is State.ARMED and outside is True:
            self._begin_run(reading)
        if self.state not in RECORDING or self._record is None:
            self._samples.append(unrecorded(reading))
            self._check_patience(reading)
            return
        sample = self._record.add(reading)
        self._samples.append(sample)
        if self.state is State.DWELLING and outside is False:
            self._fed_in(self._record, sample.t_s, reading.t_s)
        elif self.state is State.TURNING and outside is True:
            self._flush()
            self._record.fed_out_s = sample.t_s
            self._move(Cause.FED_OUT)
        elif self.state is State.LEAVING and self._record.left(sample.t_s):
            self._move(Cause.CIRCLE_FOUND if self._complete() else Cause.CIRCLE_MISSING)
        else:
            self._check_patience(reading)
        self._tell_progress()

    def _begin_run(self, reading: Reading) -> None:
        run = self._announced()
        self._flush()
        self._record = RunRecord(run, self._circle(), reading.t_s)
        self._waiting_since_s = reading.t_s
        self._out.append(events.RunStarted(run, self._programs.get((run.test, run.direction), "")))
        self._move(Cause.BAR_OUTSIDE)

    def _fed_in(self, record: RunRecord, t_s: float, now_s: float) -> None:
        self._flush()
        record.fed_in_s = t_s
        self._waiting_since_s, self._told_deg = now_s, 0.0
        self._out.append(events.FeedInSeen(record.run, t_s))
        self._move(Cause.FED_IN)

    def _tell_progress(self) -> None:
        if self.state is not State.TURNING or self._record is None:
            return
        swept = self._record.swept_deg()
        if swept >= self._told_deg + 1.0:
            self._told_deg = swept
            self._flush()
            self._out.append(events.Progress(self._record.run, swept, self._record.circle.swept_deg))

    def _check_patience(self, reading: Reading) -> None:
        """Give up on a machine that does not move, or does not stop."""
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
            self._to_next(Cause.LATE)
        else:
            self._complete(problem=problem)
            self._move(Cause.LATE)

    def _complete(self, problem: str = "") -> bool:
        """End the recording, for a reason other than its circle where one is given; return whether it holds one."""
        self._flush()
        record = self._record
        if record is None:
            raise RuntimeError(f"no run is recorded while {self.state}")
        found = None
        if not problem:
            recording = self._recorded(record.run, self._untold(record.run))
            found, problem = record.circle_figures(recording, self.plan.largest_loss_percent)
        self._out.append(events.RunCompleted(record.run, len(record), record.lost, found, problem))
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

    def _move(self, cause: Cause) -> None:
        self.state = TRANSITIONS[self.state][cause]
        self._out.append(events.StateChanged(self.state, commands_allowed(self.state)))

    def _flush(self) -> None:
        """Tell of the samples so far, before anything that comes after them."""
        if not self._samples:
            return
        samples, self._samples = tuple(self._samples), []
        if self.state in RECORDING and self._record is not None:
            self._out.append(events.SamplesRecorded(self._record.run, samples))
        else:
            self._out.append(events.ReadingsSeen(samples))

    def _untold(self, run: RunId) -> list[Sample]:
        """Samples of a run that nobody has been told of yet."""
        batches = (event for event in self._out if isinstance(event, events.SamplesRecorded) and event.run == run)
        return [sample for batch in batches for sample in batch.samples]

    def _told(self) -> list[Event]:
        self._flush()
        out, self._out = self._out, []
        return out


def _remedy(circle: Circle) -> str:
    middle = circle.bar_mm + circle.feed_in_mm / 2.0
    return f"the length has to cross {middle:.3f} mm: check bar, circle and feed-in of the plan, then repeat"
