"""Choose the next run, and its mounting, by plan order and accepted runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.files.formats.session import RunEntry, RunState
from dbbstation.station.events import RunId

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.plan.plan import Direction, Plan


@dataclass(frozen=True)
class Task:
    """One run that the plan requires.

    Attributes:
        occurrence: 1, or 2 if the plan repeats the test at its end.
    """

    test: str
    direction: Direction
    occurrence: int

    @property
    def text(self) -> str:
        """Return the task in words."""
        return f"{self.test} {self.direction}" + (" (repeated at the end)" if self.occurrence > 1 else "")


@dataclass(frozen=True)
class NextRun:
    """A task with the numbers of its recording.

    Attributes:
        number: of the task in the sequence, from 1.
    """

    run: RunId
    put_up: bool
    number: int


class Schedule:
    """Counts runs and mountings of a session."""

    def __init__(
        self,
        plan: Plan,
        next_repeat: Callable[[str, Direction], int] = lambda _test, _direction: 1,
        recorded: Sequence[RunEntry] = (),
    ) -> None:
        self.tasks = _tasks(plan)
        self._plan = plan
        self._next_repeat = next_repeat
        self._mountings = max((run.mounting or 0 for run in recorded), default=0)
        self._standing: tuple[str, int] | None = None
        self._accepted: dict[tuple[str, Direction, int], bool] = {}
        self._passed: set[Task] = set()
        self._again: Task | None = None
        self._place = 0
        for run in recorded:
            # A run that died before its mounting was noted says nothing about what stands on the table now.
            self._standing = None if run.mounting is None else (plan.tests[run.test].ball.name, run.mounting)
            if run.state is not RunState.RECORDING:
                self._accepted[run.test, run.direction, run.repeat] = run.state is RunState.ACCEPTED
        if recorded:
            # Where the last run was measured: what was left out before that comes at the end.
            self._place = self._place_of(recorded[-1])

    @property
    def accepted(self) -> int:
        """Return the number of tasks with an accepted recording."""
        return len(self.tasks) - len(self.open)

    @property
    def open(self) -> tuple[Task, ...]:
        """Return tasks without an accepted run, skipped or not."""
        runs = [(test, direction) for (test, direction, _), accepted in self._accepted.items() if accepted]
        return tuple(task for task in self.tasks if task.occurrence > runs.count((task.test, task.direction)))

    def to_come(self, run: RunId) -> int:
        """Return the number of tasks without an accepted run, apart from this run's task."""
        mine = self.tasks[self._place_of(run)]
        return sum(task != mine for task in self.open)

    def counts_beside(self, run: RunId) -> RunId | None:
        """Return another accepted run of the same task, which would also count, or None."""
        if any((task.test, task.direction) == (run.test, run.direction) for task in self.open):
            return None
        of_run = run.test, run.direction
        mine = [key for key, accepted in self._accepted.items() if accepted and key[:2] == of_run]
        return RunId(*mine[-1], 0) if mine and mine[-1][2] != run.repeat else None

    def number_of(self, run: RunId) -> int:
        """Return a run's task number, from 1."""
        return self._place_of(run) + 1

    def next(self) -> NextRun | None:
        """Return the run of the next open task that was not skipped, or None."""
        task = self._current()
        if task is None:
            return None
        ball = self._plan.tests[task.test].ball.name
        stands = self._standing is not None and self._standing[0] == ball
        mounting = self._standing[1] if self._standing is not None and stands else self._mountings + 1
        run = RunId(task.test, task.direction, self._next_repeat(task.test, task.direction), mounting)
        return NextRun(run, put_up=not stands, number=self.tasks.index(task) + 1)

    def mounted(self, run: RunId, *, remounted: bool) -> RunId:
        """Note that a run's ball is mounted, and return the run with its mounting; `remounted` makes a new one."""
        if remounted and run.mounting <= self._mountings:
            run = RunId(run.test, run.direction, run.repeat, self._mountings + 1)
        self._mountings = max(self._mountings, run.mounting)
        self._standing = (self._plan.tests[run.test].ball.name, run.mounting)
        return run

    def accept(self, run: RunId) -> None:
        """Note an accepted run and continue after it."""
        place = self._place_of(run)
        self._accepted[run.test, run.direction, run.repeat] = True
        self._place, self._again = place, None

    def recorded(self, run: RunId) -> None:
        """Note a recorded run without verdict."""
        self._accepted[run.test, run.direction, run.repeat] = False

    def judge(self, test: str, direction: Direction, repeat: int, *, accepted: bool) -> None:
        """Note another verdict on a recorded run.

        Raises:
            KeyError: there is no such recording.
        """
        if (test, direction, repeat) not in self._accepted:
            raise KeyError(f"{test}-{direction}-{repeat}")
        self._accepted[test, direction, repeat] = accepted

    def pass_over(self, run: RunId) -> None:
        """Skip a run's task."""
        self._place, self._again = self._place_of(run), None
        self._passed.add(self.tasks[self._place])

    def go_to(self, test: str, direction: Direction | None = None) -> None:
        """Make a test next, even if skipped or done.

        Raises:
            KeyError: the plan has no such run.
        """
        mine = [task for task in self.tasks if task.test == test and direction in {None, task.direction}]
        if not mine:
            raise KeyError(test)
        self._passed -= set(mine)
        left = [task for task in mine if task in self.open]
        self._again = None if left else mine[0]
        self._place = self.tasks.index((left or mine)[0])

    def _current(self) -> Task | None:
        if self._again is not None:
            return self._again
        left = [k for k, task in enumerate(self.tasks) if task in self.open and task not in self._passed]
        following = [k for k in left if k >= self._place] or left
        return self.tasks[following[0]] if following else None

    def _place_of(self, run: RunId | RunEntry) -> int:
        mine = [k for k, task in enumerate(self.tasks) if (task.test, task.direction) == (run.test, run.direction)]
        still = [k for k in mine if self.tasks[k] in self.open]
        return next((k for k in still if self.tasks[k] not in self._passed), (still or mine)[-1])


def _tasks(plan: Plan) -> tuple[Task, ...]:
    names = [(name, 1) for name in plan.tests] + [(name, 2) for name in plan.repeat_at_end]
    return tuple(Task(name, direction, nth) for name, nth in names for direction in plan.tests[name].directions)
