"""The live reading: length, deviation, status, rate."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.instrument.reading import DOUBTFUL
from dbbstation.station.detector import seat
from dbbstation.station.states import State
from dbbstation.tui.panel import Panel, lines
from dbbstation.tui.texts import NOT_SEATED_LONG, NOT_SEATED_SHORT, SEATED, SEATED_BACKWARDS

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.service.board import Board
    from dbbstation.station.detector import BarAtFeedIn
    from dbbstation.station.events import Sample

_STALE_S = 1.5
"""Age at which the last reading is shown as old [s], so that it does not look live."""

_WITHOUT_BAR = {None, State.BETWEEN, State.ANNOUNCED, State.PAUSED, State.COMPLETE, State.FLAWED, State.FINISHED}
"""States in which the bar may be absent."""

_BEFORE_RUN = {State.ANNOUNCED, State.ARMED}
"""States in which the operator puts the bar in at the feed-in point."""

_FAR_UM = 9_999.9
"""Largest deviation that is shown in µm."""


class Age:
    """Distinguishes a live reading from a stale one."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._total = 0
        self._new_s = clock()

    def stale_s(self, board: Board) -> float | None:
        """Return the time without a reading; None if live."""
        if board.rate.total != self._total:
            self._total, self._new_s = board.rate.total, self._clock()
        old_s = self._clock() - self._new_s
        return old_s if old_s > _STALE_S else None


class ReadingPanel(Panel):
    """Two rows."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(id="reading")
        self._age = Age(clock)

    def text(self, board: Board) -> Content:
        old_s = self._age.stale_s(board)
        sample = board.sample
        if sample is None:
            return lines(Content.styled("no reading yet", "dim"), Content(""))
        return lines(
            Content(" ").join([_length(sample, stale=old_s is not None), _deviation(sample, board)]),
            Content(" · ").join(_quality(sample, board, old_s)),
        )


def seat_words(found: BarAtFeedIn) -> str:
    """Return a sentence on the bar's position at the feed-in point."""
    if found.seated:
        return SEATED
    if found.backwards:
        return SEATED_BACKWARDS
    form = NOT_SEATED_SHORT if found.long_mm < 0.0 else NOT_SEATED_LONG
    return form.format(mm=abs(found.long_mm))


def _length(sample: Sample, *, stale: bool) -> Content:
    if sample.length_mm is None:
        return Content.styled("  --.----- mm", "bold")
    return Content.styled(f"{sample.length_mm:10.5f} mm", "dim" if stale else "bold")


def _deviation(sample: Sample, board: Board) -> Content:
    if sample.length_mm is None or board.announced is None:
        return Content("")
    if board.state in _BEFORE_RUN:
        found = seat(sample.length_mm, board.announced.circle)
        return Content.styled(seat_words(found), "bold $text-success" if found.seated else "bold $text-warning")
    deviation_um = 1e3 * (sample.length_mm - board.announced.circle.bar_mm)
    if abs(deviation_um) > _FAR_UM:
        return Content("far off the circle")
    return Content(f"{deviation_um:+9.1f} µm")


def _quality(sample: Sample, board: Board, old_s: float | None) -> list[Content]:
    if sample.status == DOUBTFUL:
        # Length, why and count: what a damaged line shows must not look like the bar.
        return [Content.styled("DOUBTFUL", "bold $text-warning"), *_lost(board), Content.styled(sample.said, "dim")]
    if sample.status != "ok" and board.state in _WITHOUT_BAR:
        # Nobody has put the bar in yet: that is no fault.
        return [Content.styled(f"no bar: {sample.said or sample.status}", "dim")]
    if sample.status != "ok":
        # What the instrument says needs the room.
        return [Content.styled(f"{sample.status.upper()} {sample.said}".rstrip(), "bold $text-error")]
    return [Content.styled("ok", "$text-success"), _rate(board, old_s), *_lost(board)]


def _rate(board: Board, old_s: float | None) -> Content:
    if old_s is not None:
        return Content.styled(f"no reading for {old_s:.0f} s", "bold $text-warning")
    return Content("…/s" if board.rate.per_s is None else f"{board.rate.per_s:.0f}/s")


def _lost(board: Board) -> list[Content]:
    lost = (
        Content(f"{board.lost} lost") if not board.lost else Content.styled(f"{board.lost} lost", "bold $text-warning")
    )
    if not board.doubtful:
        return [lost]
    return [lost, Content.styled(f"{board.doubtful} doubtful", "bold $text-warning")]
