"""Progress of long work: a bar on a terminal with counts and the time that is left; nothing in a pipe.

Stages go into the log, which `--verbose` shows in place of the bar.
"""

from __future__ import annotations

import logging
import shutil
import sys
import time
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any, Protocol

import click

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

_LOG = logging.getLogger(__name__)

_WIDTH = 24
"""Characters of a bar that has a text beside it."""

_SHORT_S = 0.5
"""Work that is over sooner shows no bar: it would only flicker [s]."""

_TRUSTED = 3.0, 0.02
"""Time [s] and share of the work after which what is left is stated: a guess from less is no help."""

_MINUTE_S = 60.0


class Tell(Protocol):
    """What is told how far work has come."""

    def __call__(self, text: str, done: int = 0, of: int = 0) -> None:
        """Take a stage, and how much of it is done where that can be counted."""


@contextmanager
def progress_bar(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a bar on standard error; yields what is to be told how much of `total` is done."""
    with count_bar(label) as tell:
        yield lambda done: tell(done, total)


@contextmanager
def count_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar for work that is counted; yields what is to be told how much of how much is done.

    The bar begins when the work has taken a moment, and ends with the last piece, so that lines said afterwards stay whole.
    """
    started_s = time.monotonic()
    with ExitStack() as stack:
        bars: list[Any] = []

        def tell(done: int, of: int) -> None:
            if not bars and time.monotonic() - started_s > _SHORT_S and done < of and _shown():
                bar = click.progressbar(length=of, label=label, file=sys.stderr, show_pos=True, show_percent=False)
                bars.append(stack.enter_context(bar))
            if bars:
                bars[0].update(done - bars[0].pos)
            if done >= of:
                stack.close()
                bars.clear()

        yield tell


@contextmanager
def stage_bar(label: str, stages: Mapping[str, int]) -> Iterator[Tell]:
    """Show how far work has come that tells its stages; yields what is to be told each stage as it begins.

    A bar begins with the first stage, so that lines said before stay whole.

    Args:
        label: what is being done.
        stages: how much is done when a stage begins [%], in their order; a text belongs to the stage whose name it begins
            with.
    """
    bar = _StageBar(label, stages)
    with bar.stack:
        yield bar.tell
        bar.end()


@contextmanager
def task_bar(label: str, stages: Mapping[str, int]) -> Iterator[Tell]:
    """Show how far a task has come that reads sessions first: a bar for that, and one for its stages.

    What was noticed in the files is said between both, on lines of its own.

    Args:
        label: what is being done.
        stages: of the task once runs are read, as `stage_bar` takes them.
    """
    from dbbstation.tasks.load import READING

    with count_bar(READING) as reading, stage_bar(label, stages) as rest:

        def tell(text: str, done: int = 0, of: int = 0) -> None:
            if text == READING:
                reading(done, of)
            else:
                rest(text, done, of)

        yield tell


class _StageBar:
    """One bar over several stages."""

    def __init__(self, label: str, stages: Mapping[str, int]) -> None:
        self.stack = ExitStack()
        self._label = label
        self._stages = stages
        self._reached = 0.0
        self._told = ""
        self._bar: Any = None
        self._started_s = time.monotonic()

    def tell(self, text: str, done: int = 0, of: int = 0) -> None:
        """Move to a stage, or on within it."""
        if text != self._told:
            _LOG.info("... %s", text)
        self._told = text
        before = self._reached
        now = _reached_within(text, self._stages, done / of) if of else _reached(text, self._stages, before)
        self._reached = max(before, 1.0, now)
        self._show(f"{text} {done} of {of}" if of else text)

    def end(self) -> None:
        """Fill the bar, where one was begun."""
        if self._bar is not None:
            self._bar.update(100 - self._bar.pos, "done")

    def _show(self, text: str) -> None:
        if not _shown():
            return
        if self._bar is None:
            # Room for the ^C of a terminal is left, lest it begins a line of its own.
            room = max(shutil.get_terminal_size().columns - len(f"{self._label}  [{'':{_WIDTH}}]  100%  ^C") - 1, 0)

            def beside(item: str | None) -> str:
                whole = item or ""
                return whole if len(whole) <= room else whole[: max(room - 1, 0)] + "…"

            bar = click.progressbar(
                length=100, label=self._label, file=sys.stderr, width=_WIDTH, show_eta=False, item_show_func=beside
            )
            self._bar = self.stack.enter_context(bar)
        left = time_left(self._reached / 100.0, time.monotonic() - self._started_s)
        self._bar.update(int(self._reached) - self._bar.pos, f"{left}{text}")
        self._bar.render_progress()


def time_left(share: float, passed_s: float) -> str:
    """Return what is left of work as text before the name of its stage, such as `20 s left, `; empty where too early.

    Args:
        share: of the work that is done.
        passed_s: time since it began [s].
    """
    least_s, least = _TRUSTED
    if passed_s < least_s or share < least:
        return ""
    left_s = passed_s * (1.0 - share) / share
    return f"{left_s / _MINUTE_S:.0f} min left, " if left_s > 2.0 * _MINUTE_S else f"{left_s:.0f} s left, "


def _shown() -> bool:
    """Whether somebody looks: on a terminal, and not at the log in place of the bar."""
    context = click.get_current_context(silent=True)
    verbose = context is not None and bool(context.find_root().params.get("verbose"))
    return sys.stderr.isatty() and not verbose


def _stage_of(text: str, stages: Mapping[str, int]) -> tuple[float, float] | None:
    """Where a stage begins and the next one does [%]; None for a text of no stage."""
    names = list(stages)
    here = next((k for k, name in enumerate(names) if text.startswith(name)), None)
    if here is None:
        return None
    return stages[names[here]], 100 if here + 1 == len(names) else stages[names[here + 1]]


def _reached_within(text: str, stages: Mapping[str, int], share: float) -> float:
    """How much is done when a share of a stage is; nothing for a text of no stage [%]."""
    begins, following = _stage_of(text, stages) or (0.0, 0.0)
    return begins + share * (following - begins)


def _reached(text: str, stages: Mapping[str, int], before: float) -> float:
    """How much is done when a stage begins; one that comes again goes a quarter of the way to the next [%]."""
    stage = _stage_of(text, stages)
    if stage is None:
        return before
    begins, following = stage
    return begins if before < begins else before + max(following - before, 0.0) / 4.0
