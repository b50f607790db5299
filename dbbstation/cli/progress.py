"""Show the progress of long work: a bar with counts and remaining time on a terminal; in a pipe nothing is shown.

Lines printed meanwhile appear above the bar. Stages go into the log.
"""

from __future__ import annotations

import logging
import os
import sys
from contextlib import contextmanager
from time import monotonic as now_s
from typing import TYPE_CHECKING

import click

from dbbstation.cli.output import say
from dbbstation.text.written import on_one_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from rich.progress import Progress

    from dbbstation.computing.counted import Counted
    from dbbstation.tasks.telling import Progress as Tell

_LOG = logging.getLogger(__name__)

_WIDTH = 24
"""Width of a bar beside a text [characters]."""

_SHORT_S = 0.5
"""Time before a bar appears [s], so that short work does not flicker."""

_INTERRUPT = len("^C ")
"""Free characters at the end of the line, where a terminal shows Ctrl-C."""

_TRUSTED = 3.0, 0.02
"""Time [s] and share of the work after which the remaining time is stated; earlier estimates are too uncertain."""

_MINUTE_S = 60.0

_DUMB = {"dumb", "unknown"}
"""Terminals that cannot redraw a line: they show a bar once, when its work is done."""

COUNTED, SHARE, ENDLESS = "{task.completed:.0f} of {task.total:.0f}{task.fields[unit]}", "{task.percentage:3.0f}%", ""
"""Forms of a bar: done and total; per cent; elapsed time if the end is unknown."""


class ProgressBar:
    """A bar on standard error, drawn when first shown.

    Args:
        form: `COUNTED`, `SHARE` or `ENDLESS`.
        passing: remove the bar at its end.
    """

    def __init__(self, label: str, form: str, *, unit: str = "", passing: bool = False) -> None:
        self.label = label
        self._form = form
        self._unit = unit
        self._passing = passing
        self._drawn: Progress | None = None
        self._started_s = now_s()

    def show(self, done: float = 0.0, of: float | None = None, text: str = "", *, at_once: bool = True) -> None:
        """Show the completed part of the work."""
        left = time_left(done / of, now_s() - self._started_s) if of else ""
        beside = left + on_one_line(text)
        if self._drawn is not None:
            task = self._drawn.task_ids[0]
            self._drawn.update(task, completed=done, total=of, text=beside, refresh=at_once)
        elif _shown() and not (self._passing and os.environ.get("TERM") in _DUMB):
            self._drawn = _rich(self._form, passing=self._passing)
            self._drawn.add_task(self.label, total=of, text=beside, unit=self._unit)
            self._drawn.update(self._drawn.task_ids[0], completed=done)
            self._drawn.start()

    def end(self, *, done: bool = False) -> None:
        """Remove or keep the bar, filled if done."""
        if self._drawn is None:
            return
        if done:
            self._drawn.update(self._drawn.task_ids[0], completed=self._drawn.tasks[0].total, text="done")
        self._drawn.stop()
        self._drawn, self._started_s = None, now_s()


def _rich(form: str, *, passing: bool) -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.table import Column

    console = Console(stderr=True)
    console.width = max(console.width - _INTERRUPT, 1)
    rest = Column(no_wrap=True, overflow="ellipsis", ratio=1)
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(_WIDTH),
        TextColumn(form) if form else TimeElapsedColumn(),
        TextColumn("{task.fields[text]}", markup=False, table_column=rest),
        console=console,
        expand=True,
        redirect_stdout=False,
        refresh_per_second=5,
        transient=passing,
    )


class Compiling:
    """Reports once, with a bar, that loops are being compiled."""

    def __init__(self) -> None:
        self._bar = ProgressBar("compiling", ENDLESS, passing=True)
        self._said = False

    def __call__(self, begun: bool) -> None:  # noqa: FBT001 - as the compiler tells it
        """Show that the compilation of a loop begins or ends."""
        if not begun:
            self._bar.end()
            return
        if not self._said and _shown():
            say("compiling the numerical loops, once on this computer: up to half a minute")
            self._said = True
        if not hasattr(sys.stderr, "rich_proxied_file"):  # another bar is there already
            self._bar.show()


@contextmanager
def count_bar(label: str) -> Iterator[Counted]:
    """Show a bar; yield a callback for done and total.

    The bar appears after a moment.
    """
    bar, started_s, begun = ProgressBar(label, COUNTED), now_s(), False

    def tell(done: int, of: int) -> None:
        nonlocal begun
        begun = begun or (now_s() - started_s > _SHORT_S and done < of)
        if begun:
            bar.show(done, of, at_once=False)
        if done >= of:
            bar.end()
            begun = False

    try:
        yield tell
    finally:
        bar.end()


@contextmanager
def stage_bar(label: str, stages: Mapping[str, int]) -> Iterator[Tell]:
    """Show a bar; yield a callback for stages.

    The bar appears with the first stage.
    """
    bar, reached, told = ProgressBar(label, SHARE), 0.0, ""

    def tell(text: str, done: int = 0, of: int = 0) -> None:
        nonlocal reached, told
        new, told = text != told, text
        if new:
            _LOG.info("... %s", text)
        reached = max(reached, 1.0, _reached(text, stages, done / of if of else None, reached))
        bar.show(reached, 100.0, f"{text} {done} of {of}" if of else text, at_once=new)

    try:
        yield tell
        bar.end(done=True)
    finally:
        bar.end()


@contextmanager
def task_bar(label: str, stages: Mapping[str, int]) -> Iterator[Tell]:
    """Show bars for reading sessions and a task's stages."""
    from dbbstation.tasks.telling import READING

    with count_bar(READING) as reading, stage_bar(label, stages) as rest:

        def tell(text: str, done: int = 0, of: int = 0) -> None:
            if text == READING and READING not in stages:
                reading(done, of)
            else:
                rest(text, done, of)

        yield tell


def time_left(share: float, passed_s: float) -> str:
    """Return the remaining time, such as `20 s left, `; empty if too early."""
    least_s, least = _TRUSTED
    if passed_s < least_s or not least <= share < 1.0:
        return ""
    left_s = passed_s * (1.0 - share) / share
    return f"{left_s / _MINUTE_S:.0f} min left, " if left_s > 2.0 * _MINUTE_S else f"{left_s:.0f} s left, "


def _shown() -> bool:
    context = click.get_current_context(silent=True)
    verbose = context is not None and bool(context.find_root().params.get("verbose"))
    return sys.stderr.isatty() and not verbose


def _reached(text: str, stages: Mapping[str, int], share: float | None, before: float) -> float:
    """Return the progress [%], at a stage's begin without a share. A repeated stage advances by a quarter of the remaining way."""
    here = next((k for k, name in enumerate(stages) if text.startswith(name)), None)
    if here is None:
        return before
    begins, following = (*stages.values(), 100)[here : here + 2]
    if share is not None:
        return begins + share * (following - begins)
    return begins if before < begins else before + max(following - before, 0.0) / 4.0
