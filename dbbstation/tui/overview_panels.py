"""Parts of the overview: what is left, the plate, the list of tests, the chosen run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.plan.duration import circles_s
from dbbstation.service.board import Mark, Verdict
from dbbstation.station.commands import GoTo
from dbbstation.tui import texts
from dbbstation.tui.panel import Panel, lines
from dbbstation.tui.run_list import SIGNS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.plan.circle import Direction
    from dbbstation.service.board import Board
    from dbbstation.station.schedule import Task
    from dbbstation.tui.shown import Shown

_CELL = 12
"""Columns of a place on the map at least: a bore, or a test with its signs."""

_WORD = 15
"""Columns of a run in the list: direction, sign and the longest word."""

_FIGURE = 8
"""Columns of a run's circularity, where there is room."""

_SHORTEST_NAME = 5


@dataclass
class Choice:
    """The chosen test and direction.

    Attributes:
        tests: names in the plan's order.
        at: place of the chosen one.
        way: 0 for its first direction, 1 for its second.
    """

    tests: Sequence[str]
    at: int = 0
    way: int = 0

    @property
    def test(self) -> str:
        """Name of the chosen test; empty where there are none."""
        return self.tests[self.at] if self.tests else ""

    def direction(self, shown: Shown) -> Direction:
        """Return the chosen direction; the only one where the test has one."""
        directions = shown.tests[self.test].directions
        return directions[min(self.way, len(directions) - 1)]


class LeftLine(Panel):
    """What is left and how long that takes; a hint where the keys have to wait."""

    DEFAULT_CSS = "LeftLine { height: 2; padding: 0 1; background: $surface; }"

    def __init__(self, shown: Shown, *, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__(id=id)
        self._show = shown

    def text(self, board: Board) -> Content:
        """Return the sentence."""
        if GoTo not in board.allowed and board.state is not None:
            return Content(texts.NOT_NOW.format(state=board.state))
        if not board.left:
            return Content(texts.NOTHING_LEFT.format(count=len(board.tasks)))
        seconds = circles_s(self._show.tests[task.test].run(task.direction) for task in board.left)
        time = f"{seconds / 60.0:.0f} min" if seconds >= 90.0 else f"{seconds:.0f} s"  # noqa: PLR2004 - below that, minutes are coarse
        return Content(texts.TIME_LEFT.format(left=len(board.left), count=len(board.tasks), time=time))


class PlateMap(Panel):
    """Bores where they are, under each its tests with a sign per direction and, where there is room, the greatest circularity."""

    DEFAULT_CSS = "PlateMap { height: 1fr; padding: 0 1; }"

    def __init__(self, shown: Shown, choice: Choice, *, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__(id=id)
        self._show = shown
        self._choice = choice

    def text(self, board: Board) -> Content:
        """Return the map; balls in no bore stand side by side below it."""
        signs = _signs(board)
        bores = self._show.bores
        xs = sorted({x for x, _ in bores.values()})
        ys = sorted({y for _, y in bores.values()}, reverse=True)
        width = max(self.content_size.width // max(len(xs), 1), _CELL)
        gap = max((self.content_size.height - _rows_needed(self._show)) // max(len(ys), 1), 0)
        # Rows stand no further apart than columns: a cell of the terminal is about twice as high as wide.
        gap = min(gap, width // 2 - 1)
        rows: list[Content] = []
        for y in ys:
            in_row = {x: number for number, (x, at) in bores.items() if at == y}
            cells = [self._bore(in_row.get(x), board, signs, width) for x in xs]
            deepest = max(len(cell) for cell in cells)
            empty = Content(" " * width)
            rows += [Content("").join([cell[k] if k < len(cell) else empty for cell in cells]) for k in range(deepest)]
            rows += [Content("")] * gap
        elsewhere = [name for name, test in self._show.tests.items() if test.ball.bore not in bores]
        if elsewhere:
            rows.append(Content.styled(texts.NO_BORE, "dim"))
            rows += [self._test(name, board, signs, width) for name in elsewhere]
        return lines(*rows)

    def _bore(self, number: int | None, board: Board, signs: dict[str, list[Mark]], width: int) -> list[Content]:
        if number is None:
            return []
        mine = [name for name, test in self._show.tests.items() if test.ball.bore == number]
        title = texts.BORE.format(number=number)
        return [
            Content.styled(f"{title:{width}}", "bold" if mine else "dim"),
            *(self._test(name, board, signs, width) for name in mine),
        ]

    def _test(self, name: str, board: Board, signs: dict[str, list[Mark]], width: int) -> Content:
        chosen = name == self._choice.test
        room = _CELL - 7
        parts = [
            Content.styled(f"{'▸' if chosen else ' '}{_cut(name, room):{room}} ", "reverse bold" if chosen else "")
        ]
        parts += [Content.styled(*SIGNS[mark]) for mark in signs.get(name, [])]
        figures = [
            board.latest[name, way].figures for way in self._show.tests[name].directions if (name, way) in board.latest
        ]
        known = [one.circularity_um for one in figures if one is not None]
        if known and width >= _CELL + _FIGURE:
            parts.append(Content(f"{max(known):6.1f} µm"[: _FIGURE + 1]))
        text = Content("").join(parts)
        return text + Content(" " * max(width - len(text.plain), 0))


class TestList(Panel):
    """As many tests as fit, the chosen one among them; the chosen direction stands in brackets."""

    __test__ = False
    """Not one of pytest's."""

    DEFAULT_CSS = "TestList { height: 1fr; padding: 0 1; }"

    def __init__(self, choice: Choice, *, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__(id=id)
        self._choice = choice

    def text(self, board: Board) -> Content:
        """Return a row per test."""
        grouped: dict[tuple[str, int], list[tuple[Task, Mark]]] = {}
        for task, mark in zip(board.tasks, board.marks, strict=True):
            grouped.setdefault((task.test, task.occurrence), []).append((task, mark))
        width = self.content_size.width
        wide = width >= _SHORTEST_NAME + 2 * (_WORD + _FIGURE)
        each = _WORD + (_FIGURE if wide else 0)
        room = max(width - 2 * (each + 1), _SHORTEST_NAME)
        rows: list[Content] = []
        at = 0
        for (name, occurrence), group in grouped.items():
            chosen = name == self._choice.test and occurrence == 1
            at = len(rows) if chosen else at
            title = name if occurrence == 1 else f"{name} again"
            row = [
                Content.styled(f"{'▸' if chosen else ' '}{_cut(title, room - 1):{room - 1}}", "bold" if chosen else "")
            ]
            for way, (task, mark) in enumerate(group):
                marked = chosen and way == min(self._choice.way, len(group) - 1)
                row.append(_run(board, task, mark, marked=marked, wide=wide))
            rows.append(Content("").join(row))
        height = max(self.content_size.height, 1)
        first = min(max(at - height // 2, 0), max(len(rows) - height, 0))
        return lines(*rows[first : first + height])


class ChosenRun(Panel):
    """The last run of the chosen test and direction: figures and verdict."""

    DEFAULT_CSS = "ChosenRun { height: 2; padding: 0 1; background: $surface; text-style: bold; }"

    def __init__(self, shown: Shown, choice: Choice, *, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__(id=id)
        self._show = shown
        self._choice = choice

    def text(self, board: Board) -> Content:
        """Return the sentence."""
        if not self._choice.tests:
            return Content("")
        test, direction = self._choice.test, self._choice.direction(self._show)
        completed = board.latest.get((test, direction))
        if completed is None or completed.figures is None:
            return Content(f"{texts.NO_RUN.format(test=test, direction=direction)}\n{texts.CHOOSE}")
        x, y = (1e3 * part for part in completed.figures.centre_mm)
        said = texts.LAST_RUN.format(
            run=completed.run.label,
            x=x,
            y=y,
            mean=completed.figures.mean_radial_error_um,
            circularity=completed.figures.circularity_um,
            verdict=board.verdicts.get(completed.run.label, Verdict.NONE).value or texts.NO_VERDICT,
        )
        return Content(f"{said}\n{texts.CHOOSE}")


def _signs(board: Board) -> dict[str, list[Mark]]:
    """Marks of each test's runs, those that are repeated at the end behind the others."""
    marks: dict[str, list[Mark]] = {}
    for task, mark in zip(board.tasks, board.marks, strict=True):
        marks.setdefault(task.test, []).append(mark)
    return marks


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
    completed = board.latest.get((task.test, task.direction)) if task.occurrence == 1 else None
    known = completed is not None and completed.figures is not None and mark is not Mark.RUNNING
    figure = f"{completed.figures.circularity_um:5.1f} µm" if known and completed and completed.figures else ""
    return cell + Content(f"{figure:{_FIGURE}}")


def _rows_needed(shown: Shown) -> int:
    """Rows of the map without any empty row between bores."""
    ys = {y for _, y in shown.bores.values()}
    deepest = 0
    for y in ys:
        in_row = [number for number, (_, at) in shown.bores.items() if at == y]
        deepest += 1 + max(sum(test.ball.bore == number for test in shown.tests.values()) for number in in_row)
    return deepest


def _cut(name: str, room: int) -> str:
    return name if len(name) <= room else f"{name[: room - 1]}…"
