"""Sentences for the next action and for faults."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.quality.answer import Advice
from dbbstation.service.board import problem_alone
from dbbstation.station.states import State

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.quality.answer import RunAssessment
    from dbbstation.service.board import Board

_S_PER_MIN, _MIN_PER_H = 60.0, 60


def duration(time_s: float) -> str:
    """Return a time, such as `35 s`, `12 min` or `1 h 05 min`."""
    if time_s < _S_PER_MIN:
        return f"{time_s:.0f} s"
    minutes = round(time_s / _S_PER_MIN)
    return f"{minutes} min" if minutes < _MIN_PER_H else f"{minutes // _MIN_PER_H} h {minutes % _MIN_PER_H:02d} min"


_BEGIN = "Opening instrument and session …"


def now(board: Board) -> str:
    """Return a sentence on what to do or wait for."""
    if board.fault is not None:
        return _fault(board)
    if board.state is None:
        return _BEGIN
    if board.finished is not None:
        return _finished(board)
    say = _SENTENCES.get(board.state, f"The station is {board.state}.")
    return say if isinstance(say, str) else say(board)


def now_for_operator(board: Board, trouble: str = "") -> str:
    """Return the sentence for an operator, who can only repeat a faulty run. In trouble it is the shop's text."""
    completed = board.completed
    if board.fault is not None:
        return f"{_fault(board, commands=False)} {trouble}".rstrip()
    if board.state not in {State.COMPLETE, State.FLAWED} or completed is None:
        return now(board) if board.finished is None else _THROUGH
    found = completed.answer
    if board.doubted:
        return _looked_back(board)
    if found.word is Advice.REPEAT:
        return f"{found.word}  {completed.run.label}: {_ended(found.causes[0])} Enter measures it again."
    if found.word is Advice.CANNOT_TELL:
        return f"{found.word}  {completed.run.label}: {_unseen(found)} {_both(board)}U goes on all the same, R measures it again."
    return f"{found.word}  {completed.run.label}. {_both(board)}{_later(found)}Enter goes on."


_THROUGH = "Every circle is measured: the answer follows."


def _set_up(board: Board) -> str:
    announced = board.announced
    if announced is None:
        return _BEGIN
    return f"{announced.instructions[0]}, tilt and bar as shown; then press Enter."


def _armed(board: Board) -> str:
    step = board.announced.instructions[-1] if board.announced else "Start the circle"
    return f"{step} at the machine; the recording begins and ends by itself."


def _verdict(board: Board) -> str:
    if board.completed is None:
        return "The run is complete."
    name, found = board.completed.run.label, board.completed.answer
    if board.doubted:
        return f"{_looked_back(board)} A accepts this one and leaves them."
    if found.word is Advice.REPEAT:
        more = f" ({len(found.causes) - 1} more)" if len(found.causes) > 1 else ""
        return f"{found.word}  {name}: {_ended(found.causes[0])}{more} Enter or R measures it again; A asks why it counts all the same."
    if found.word is Advice.CANNOT_TELL:
        return (
            f"{found.word}  {name}: {_unseen(found)} {_both(board)}U or A accepts it all the same, R measures it again."
        )
    return f"{found.word}  {name}. {_both(board)}{_later(found)}Enter or A accepts it, R measures it again, X rejects it and goes on."


def _both(board: Board) -> str:
    beside = None if board.completed is None else board.completed.counts_beside
    return f"{beside.label} counts too: Z accepts this one in its place. " if beside is not None else ""


def _unseen(found: RunAssessment) -> str:
    settled = f" It takes {'; '.join(found.settled_by)}." if found.settled_by else ""
    return f"{', '.join(found.unseen)}.{settled}"


def _later(found: RunAssessment) -> str:
    return f"Later circles show {', '.join(found.later)}. " if found.later else ""


def _looked_back(board: Board) -> str:
    first = next(iter(board.doubted.values()))
    completed = board.completed
    mine = f"{completed.answer.word}  {completed.run.label}. " if completed is not None else ""
    what = first.finding.short or first.finding.text
    return f"{mine}But {', '.join(board.doubted)} must be measured again: {_ended(what)} Enter goes back to test {first.run.test}."


def _flawed(board: Board) -> str:
    problem = problem_alone(board.completed) if board.completed else ""
    name = board.completed.run.label if board.completed else "the run"
    return f"{Advice.REPEAT}  {name} has no usable circle: {_ended(problem)} Enter or R measures it again, X leaves it out."


_SENTENCES: dict[State, str | Callable[[Board], str]] = {
    State.ANNOUNCED: _set_up,
    State.ARMED: _armed,
    State.DWELLING: "The bar stands at the feed-in point: the machine feeds in next, touch nothing.",
    State.TURNING: "The machine runs the circle: touch nothing until it has fed out.",
    State.LEAVING: "The circle is through, the machine feeds out: touch nothing; the word on it follows.",
    State.COMPLETE: _verdict,
    State.FLAWED: _flawed,
    State.PAUSED: "Pause: nothing is recorded and nothing is waited for. P goes on.",
}


def _finished(board: Board) -> str:
    finished = board.finished
    missing = ", ".join(finished.missing) if finished else ""
    rest = f"without an accepted run: {missing}" if missing else "nothing is missing"
    return f"The plan is through, {board.accepted} of {len(board.tasks)} runs accepted; {rest}. E works on the results, Q leaves."


def _fault(board: Board, *, commands: bool = True) -> str:
    if board.fault is None:
        return ""
    error, interrupted = board.fault.error, board.fault.interrupted
    where = f" at {error.where}" if error.where else ""
    kept = f" {interrupted.label} is kept as far as it came." if interrupted else ""
    remedy = f" What helps: {_ended(error.remedy)}" if error.remedy and (commands or "`" not in error.remedy) else ""
    return f"FAULT{where}: {_ended(error.what)}{remedy}{kept} Then C connects again, Q leaves."


def _ended(text: str) -> str:
    return text if text.endswith((".", "?", "!")) else f"{text}."
