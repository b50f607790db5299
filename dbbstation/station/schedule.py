"""Which run comes next: the plan's order, less what the session has accepted already, and which mounting it belongs to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.files.recordings.entries import RunEntry, RunState
from dbbstation.station.events import RunId

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.plan.circle import Direction
    from dbbstation.plan.plan import Plan


@dataclass(frozen=True)
class Task:
    """One run that the plan asks for.

    Attributes:
        test: name of the test.
        direction: sense of travel.
        occurrence: 1, or 2 where the plan repeats the test at its end.
    """

    test: str
    direction: Direction
    occurrence: int

    @property
    def text(self) -> str:
        """As people read it."""
        return f"{self.test} {self.direction}" + (" (repeated at the end)" if self.occurrence > 1 else "")


@dataclass(frozen=True)
class NextRun:
    """A task with the numbers that its recording gets.

    Attributes:
        run: the recording.
        put_up: its ball has to be put up first.
        number: of the task in the sequence, from 1.
    """

    run: RunId
    put_up: bool
    number: int


class Schedule:
    """Keeps count of runs and mountings.

    Args:
        plan: what is to be measured.
        next_repeat: which repeat of a test and direction is free; the session folder knows.
        recorded: runs of the session so far, in the order they were started, of every state.
    """

    def __init__(
        self, plan: Plan, next_repeat: Callable[[str, Direction], int], recorded: Sequence[RunEntry] = ()
    ) -> None:
        self.tasks = _tasks(plan)
        self._plan = plan
        self._next_repeat = next_repeat
        self._mountings = max((run.mounting or 0 for run in recorded), default=0)
        self._standing: tuple[str, int] | None = None
        self._done: set[Task] = set()
        self._passed: set[Task] = set()
        for run in recorded:
            # A run that died before its mounting was noted says nothing about what stands on the table now.
            self._standing = None if run.mounting is None else (plan.tests[run.test].ball.name, run.mounting)
            if run.state is RunState.ACCEPTED:
                self._count(run.test, run.direction)

    @property
    def accepted(self) -> int:
        """Tasks that have an accepted recording."""
        return len(self._done)

    @property
    def open(self) -> tuple[Task, ...]:
        """Tasks without an accepted recording, passed over or not."""
        return tuple(task for task in self.tasks if task not in self._done)

    def next(self) -> NextRun | None:
        """Return the first task that is neither done nor passed over; None where all are."""
        task = self._current()
        if task is None:
            return None
        ball = self._plan.tests[task.test].ball.name
        stands = self._standing is not None and self._standing[0] == ball
        mounting = self._standing[1] if self._standing is not None and stands else self._mountings + 1
        run = RunId(task.test, task.direction, self._next_repeat(task.test, task.direction), mounting)
        return NextRun(run, put_up=not stands, number=self.tasks.index(task) + 1)

    def mounted(self, run: RunId, *, remounted: bool) -> RunId:
        """Note that the ball of a run stands now; with `remounted` its holder was touched, which makes a new mounting.

        Returns:
            The run with its mounting.
        """
        if remounted and run.mounting <= self._mountings:
            run = RunId(run.test, run.direction, run.repeat, self._mountings + 1)
        self._mountings = max(self._mountings, run.mounting)
        self._standing = (self._plan.tests[run.test].ball.name, run.mounting)
        return run

    def accept(self, run: RunId) -> None:
        """Note that a run counts."""
        self._count(run.test, run.direction)

    def pass_over(self) -> None:
        """Leave the current task for another time."""
        task = self._current()
        if task is not None:
            self._passed.add(task)

    def _current(self) -> Task | None:
        return next((task for task in self.tasks if task not in self._done and task not in self._passed), None)

    def _count(self, test: str, direction: Direction) -> None:
        """Give an accepted recording to the first open task of its test and direction; more than planned do no harm."""
        mine = [task for task in self.open if (task.test, task.direction) == (test, direction)]
        self._done.update(mine[:1])


def _tasks(plan: Plan) -> tuple[Task, ...]:
    names = [(name, 1) for name in plan.tests] + [(name, 2) for name in plan.repeat_at_end]
    return tuple(Task(name, direction, nth) for name, nth in names for direction in plan.tests[name].directions)
