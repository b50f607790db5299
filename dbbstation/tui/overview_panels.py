"""Parts of the overview."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.computing.grouped import grouped
from dbbstation.plan.plan import Direction, circles_s
from dbbstation.quality.finding import against_limit
from dbbstation.service.board import Mark, RunDecision, problem_alone
from dbbstation.station.commands import GoTo
from dbbstation.station.states import State
from dbbstation.tui.panel import Panel, cut, lines, window
from dbbstation.tui.run_list import SIGNS
from dbbstation.tui.run_list import STYLES as FINDING_STYLES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.service.board import Board
    from dbbstation.station.events import RunCompleted
    from dbbstation.station.schedule import Task
    from dbbstation.tui.board_screen import Shown

_CELL = 12
"""Least number of columns of a bore on the map, or of a test with its signs."""

_WORD = 15
"""Columns of a run in the list: direction, sign and the longest word."""

_FIGURE = 8
"""Columns of a run's circularity, if there is space."""

_IN_WORDS = 22
"""Columns of a direction on the map beside the test's name: direction, sign, longest word, circularity."""

_SHORTEST_NAME = 5


@dataclass
class ChosenTest:
    """The chosen test and direction."""

    tests: Sequence[str]
    at: int = 0
    way: int = 0
    back: int = 0

    @property
    def test(self) -> str:
        """Return the chosen test; empty without tests."""
        return self.tests[self.at] if self.tests else ""

    def direction(self, shown: Shown) -> Direction:
        """Return the chosen direction, or the test's only one."""
        directions = shown.tests[self.test].directions
        return directions[min(self.way, len(directions) - 1)]

    def runs(self, board: Board, shown: Shown) -> tuple[RunCompleted, ...]:
        return board.runs_of(self.test, self.direction(shown)) if self.tests else ()

    def run(self, board: Board, shown: Shown) -> RunCompleted | None:
        """Return the chosen run, or None."""
        runs = self.runs(board, shown)
        return runs[-1 - min(self.back, len(runs) - 1)] if runs else None


class LeftLine(Panel):
    """The remaining runs with their duration, and a hint while keys wait."""

    def __init__(self, shown: Shown) -> None:
        super().__init__(id="left")
        self._show = shown

    def text(self, board: Board) -> Content:
        if board.state is State.FINISHED:
            return Content(
                "The plan is through. X takes a verdict back: what does not count any more is measured again."
            )
        if GoTo not in board.allowed and board.state is not None:
            return Content(
                f"While the station is {board.state}, tests are looked at here; going to another and other verdicts have to wait."
            )
        if not board.left:
            return Content(f"All {len(board.tasks)} runs of the plan are accepted.")
        seconds = circles_s(self._show.tests[task.test].run(task.direction) for task in board.left)
        time = f"{seconds / 60.0:.0f} min" if seconds >= 90.0 else f"{seconds:.0f} s"  # noqa: PLR2004 - below that, minutes are coarse
        return Content(
            f"{len(board.left)} of {len(board.tasks)} runs are left; their circles take {time} at the planned feeds, putting up balls comes on top."
        )


class PlateMap(Panel):
    """Map of the bores with their tests: a row per direction with sign, verdict and circularity."""

    def __init__(self, shown: Shown, choice: ChosenTest) -> None:
        super().__init__(id="plate")
        self._show = shown
        self._choice = choice
        self._name_room = min(max(map(len, shown.tests), default=0), _CELL - 7)

    def text(self, board: Board) -> Content:
        bores = self._show.bores
        xs = sorted({x for x, _ in bores.values()})
        ys = sorted({y for _, y in bores.values()}, reverse=True)
        width = max(self.content_size.width // max(len(xs), 1), _CELL)
        height = self.content_size.height
        words = width > self._name_room + _IN_WORDS and height >= _rows_needed(self._show, per_test=len(Direction))
        gap = max((height - _rows_needed(self._show, per_test=len(Direction) if words else 1)) // max(len(ys), 1), 0)
        # Rows stand no further apart than columns: a cell of the terminal is about twice as high as wide.
        gap = min(gap, width // 2 - 1)
        rows: list[Content] = []
        for y in ys:
            in_row = {x: number for number, (x, at) in bores.items() if at == y}
            cells = [self._bore(in_row.get(x), board, width, words=words) for x in xs]
            deepest = max(len(cell) for cell in cells)
            empty = Content(" " * width)
            rows += [Content("").join([cell[k] if k < len(cell) else empty for cell in cells]) for k in range(deepest)]
            rows += [Content("")] * gap
        elsewhere = [name for name, test in self._show.tests.items() if test.ball.bore not in bores]
        if elsewhere:
            rows.append(Content.styled("in no bore", "dim"))
            rows += [self._test(name, board, width) for name in elsewhere]
        return lines(*rows)

    def _bore(self, number: int | None, board: Board, width: int, *, words: bool) -> list[Content]:
        if number is None:
            return []
        mine = [name for name, test in self._show.tests.items() if test.ball.bore == number]
        title = f"bore {number}"
        rows = [Content.styled(f" {title:{width - 1}}", "bold" if mine else "dim")]
        for name in mine:
            rows += self._directions(name, board, width) if words else [self._test(name, board, width)]
        return rows

    def _directions(self, name: str, board: Board, width: int) -> list[Content]:
        rows: list[Content] = []
        for task, mark in board.marks_of(name):
            if task.occurrence > 1:
                continue
            sign, style = SIGNS[mark]
            before = self._titled(name) if not rows else Content(" " * (self._name_room + 2))
            text = before + Content.assemble(f"{task.direction.value:3} ", (f"{sign} {mark.value:9}", style))
            known = board.figures_of(name, task.direction)
            rows.append(_filled(text, None if known is None else known.circularity_um, width))
        return rows

    def _test(self, name: str, board: Board, width: int) -> Content:
        text = self._titled(name)
        for _, mark in board.marks_of(name):
            text += Content.styled(*SIGNS[mark])
        figures = [board.figures_of(name, way) for way in self._show.tests[name].directions]
        known = [one.circularity_um for one in figures if one is not None]
        return _filled(text, max(known) if known else None, width)

    def _titled(self, name: str) -> Content:
        chosen = name == self._choice.test
        text = f"{'▸' if chosen else ' '}{cut(name, self._name_room):{self._name_room}} "
        return Content.styled(text, "reverse bold" if chosen else "")


def _filled(text: Content, figure_um: float | None, width: int) -> Content:
    told = () if figure_um is None else (f"{figure_um:5.1f} µm", f"{figure_um:5.1f}", f" {figure_um:.0f}")
    fitting = [figure for figure in told if len(text.plain) + len(figure) < width]
    text += Content(fitting[0] if fitting else "")
    return text + Content(" " * max(width - len(text.plain), 0))


class TestList(Panel):
    """List of as many tests as fit around the chosen one, with the direction in brackets."""

    __test__ = False
    """Keeps pytest from collecting this class."""

    def __init__(self, choice: ChosenTest) -> None:
        super().__init__(id="tests")
        self._choice = choice

    def text(self, board: Board) -> Content:
        marked_tasks = zip(board.tasks, board.marks, strict=True)
        groups = grouped(((task.test, task.occurrence), (task, mark)) for task, mark in marked_tasks)
        width = self.content_size.width
        wide = width >= _SHORTEST_NAME + 2 * (_WORD + _FIGURE)
        each = _WORD + (_FIGURE if wide else 0)
        room = max(width - 2 * (each + 1), _SHORTEST_NAME)
        rows: list[Content] = []
        at = 0
        for (name, occurrence), group in groups.items():
            chosen = name == self._choice.test and occurrence == 1
            at = len(rows) if chosen else at
            title = name if occurrence == 1 else f"{name} again"
            row = [
                Content.styled(f"{'▸' if chosen else ' '}{cut(title, room - 1):{room - 1}}", "bold" if chosen else "")
            ]
            for way, (task, mark) in enumerate(group):
                marked = chosen and way == min(self._choice.way, len(group) - 1)
                row.append(_run(board, task, mark, marked=marked, wide=wide))
            rows.append(Content("").join(row))
        return window(rows, at, self.content_size.height)


class ChosenRun(Panel):
    """The chosen run: figures, verdict, reason, findings."""

    def __init__(self, shown: Shown, choice: ChosenTest) -> None:
        super().__init__(id="chosen")
        self._show = shown
        self._choice = choice

    def text(self, board: Board) -> Content:
        if not self._choice.tests:
            return Content("")
        completed = self._choice.run(board, self._show)
        if completed is None:
            direction = self._choice.direction(self._show)
            nothing = f"{self._choice.test} {direction}: no run yet."
            return lines(Content(nothing), Content(""), Content("Arrow keys choose test and direction."))
        count = len(self._choice.runs(board, self._show))
        place = count - min(self._choice.back, count - 1)
        which = (
            f"Run {place} of {count} of this test and direction: H shows an earlier one. Arrow keys choose another."
            if count > 1
            else "No earlier run of this test and direction. Arrow keys choose another."
        )
        return lines(Content(_figures(completed)), _decided(board, completed), Content(which))


def _figures(completed: RunCompleted) -> str:
    label, figures = completed.run.label, completed.figures
    if figures is None:
        return f"{label}: no circle; {problem_alone(completed)}"
    x, y = (1e3 * part for part in figures.centre_mm)
    mean, circularity = figures.mean_radial_error_um, figures.circularity_um
    return f"{label}: centre X {x:+.1f} Y {y:+.1f}, mean {mean:+.1f}, circularity {circularity:.1f} µm."


def _decided(board: Board, completed: RunCompleted) -> Content:
    label = completed.run.label
    verdict = board.verdicts.get(label, RunDecision.NONE).value or "waits for its verdict"
    reason = board.reasons.get(label, "")
    parts = [Content(f"{verdict}: {reason}" if reason else verdict)]
    parts += [
        Content.assemble(
            f"{finding.name.value} {against_limit(finding)} ", (finding.verdict.value, FINDING_STYLES[finding.verdict])
        )
        for finding in completed.wrong
    ]
    return Content(" · ").join(parts)


def _run(board: Board, task: Task, mark: Mark, *, marked: bool, wide: bool) -> Content:
    sign, style = SIGNS[mark]
    word = f"{sign} {mark.value}"
    before, behind = ("[", "]") if marked else (" ", " ")
    cell = Content.assemble(
        (f"{before}{task.direction.value:3} ", "bold" if marked else ""),
        (word, style),
        (f"{behind}".ljust(_WORD - 4 - len(word)), "bold" if marked else ""),
    )
    if not wide:
        return cell
    known = board.figures_of(task.test, task.direction) if task.occurrence == 1 else None
    figure = "" if known is None or mark is Mark.RUNNING else f"{known.circularity_um:5.1f} µm"
    return cell + Content(f"{figure:{_FIGURE}}")


def _rows_needed(shown: Shown, per_test: int) -> int:
    ys = {y for _, y in shown.bores.values()}
    deepest = 0
    for y in ys:
        in_row = [number for number, (_, at) in shown.bores.items() if at == y]
        deepest += 1 + per_test * max(
            sum(test.ball.bore == number for test in shown.tests.values()) for number in in_row
        )
    return deepest
