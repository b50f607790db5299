"""Every error that a user can cause, and refusals of the operating system: what is wrong, where, and what to do."""

from __future__ import annotations

import errno
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from dbbstation.text.written import natural, on_one_line

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence

Thing = TypeVar("Thing")
Read = TypeVar("Read")


@dataclass(frozen=True, order=True)
class Problem:
    """One fault at one place of a file; `line` and `column` count from 1, 0 if unknown."""

    file: str
    line: int
    column: int
    what: str
    remedy: str = ""

    @classmethod
    def of(cls, file: object, what: str, remedy: str = "", line: int = 0, column: int = 0) -> Problem:
        """Return a fault of a whole file, or of a line of it."""
        return cls(str(file), line, column, what, remedy)

    def __str__(self) -> str:
        """Return `file:line:column: what; remedy`, the form that editors jump to."""
        place = self.file
        if self.line:
            place += f":{self.line}"
            if self.column:
                place += f":{self.column}"
        what = f"{self.what}; {self.remedy}" if self.remedy else self.what
        if len(what) > LONGEST_SAID:
            what = f"{what[: LONGEST_SAID // 2]} … {what[-LONGEST_SAID // 2 :]}"
        return f"{place}: {what}".replace("\n", "\\n")


class Faults(list[Problem]):
    """Faults of one file."""

    def __init__(self, file: object) -> None:
        super().__init__()
        self.file = str(file)

    def add(self, what: str, remedy: str = "", line: int = 0, column: int = 0) -> None:
        """Add a fault of the file, or of a line of it."""
        self.append(Problem(self.file, line, column, what, remedy))


MOST_FAULTS = 20
"""Greatest number of listed faults of one kind."""


MOST_LISTED = 200
"""Greatest number of faults that an error lists: ten kinds, or ten files."""

LONGEST_SAID = 1000
"""Greatest number of characters of a fault: four times the longest list of known keys."""


def few(problems: Sequence[Problem], count: int | None = None) -> list[Problem]:
    """Return the problems; of very many, return the first ones and the count of the others.

    Args:
        count: total number, if `problems` has only the first `MOST_FAULTS` + 1.
    """
    more = (count or len(problems)) - MOST_FAULTS
    if more <= 0:
        return list(problems)
    last = problems[MOST_FAULTS]
    what = f"and {more} more of these from here on"
    return [*problems[:MOST_FAULTS], Problem(last.file, last.line, last.column, what)]


class StationError(Exception):
    """Base of all errors that a user can cause.

    Args:
        what: one sentence without a full stop.
        where: file, port, run or pose.
        remedy: what the user can do.
    """

    def __init__(self, what: str, *, where: str = "", remedy: str = "") -> None:
        self.what = what
        self.where = where
        self.remedy = remedy
        super().__init__(what, where, remedy)

    def __reduce__(self) -> tuple[object, ...]:
        """Let the error be pickled despite its keyword arguments."""
        return _as_it_was, (type(self), self.args, self.__dict__)

    def __str__(self) -> str:
        where = on_one_line(self.where)
        text = f"{where}: {self.what}" if where else self.what
        return f"{text}; {self.remedy}" if self.remedy else text


def _as_it_was(kind: type[StationError], args: tuple[object, ...], state: dict[str, object]) -> StationError:
    error = kind.__new__(kind)
    error.args = args
    error.__dict__.update(state)
    return error


class InputError(StationError):
    """Wrong content of a file, with every fault found."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(sorted(problems, key=lambda one: (natural(one.file), one)))
        lines = [str(problem) for problem in self.problems[:MOST_LISTED]]
        if len(self.problems) > MOST_LISTED:
            lines.append(f"and {len(self.problems) - MOST_LISTED} more faults")
        super().__init__("\n".join(lines))

    @classmethod
    def of(cls, file: object, what: str, remedy: str = "", line: int = 0, column: int = 0) -> InputError:
        """Return the error of one fault."""
        return cls([Problem.of(file, what, remedy, line, column)])


def refuse(faults: Collection[Problem]) -> None:
    """Raise all faults as one error.

    Raises:
        InputError: there is a fault.
    """
    if faults:
        raise InputError(faults)


def read_each(read: Callable[[Thing], Read], things: Iterable[Thing]) -> list[Read]:
    """Return what is read of each thing.

    Raises:
        InputError: the faults of all.
    """
    found: list[Read] = []
    faults: list[Problem] = []
    for one in things:
        try:
            found.append(read(one))
        except InputError as error:
            faults += error.problems
    refuse(faults)
    return found


class ArgumentError(StationError, ValueError):
    """A value that a task does not accept; `where` is the parameter."""

    def __init__(self, parameter: str, what: str, remedy: str = "") -> None:
        super().__init__(what, where=parameter, remedy=remedy)


class OutputError(StationError):
    """A result cannot be written."""


class MachineError(StationError):
    """A pose or path that the machine cannot take."""


class KinematicsError(MachineError):
    """The forward kinematics found no pose for these strut lengths."""


class TravelError(MachineError):
    """A pose or strut length outside the travel."""


class TraceError(StationError):
    """A recording that does not show its planned circle."""


class ModelError(StationError):
    """An error source is unknown, or lacks data that it needs."""


class CalibrationError(StationError):
    """The recordings do not determine the requested fit."""


class InstrumentError(StationError):
    """An error of the port, the wire or the instrument."""


_REMEDIES = {
    errno.ENOSPC: "free room on the disk, then try again",
    errno.EDQUOT: "free room in your share of the disk, then try again",
    errno.EROFS: "name a place that can be written: this one can only be read",
    errno.EIO: "check the disk and its cable, and copy what is on it before you go on",
    errno.EACCES: "check the permissions of file and folder",
    errno.EPERM: "check the permissions of file and folder",
    errno.EMFILE: "close other programs: too many files are open",
    errno.ENAMETOOLONG: "shorten the name",
    errno.ENFILE: "close other programs: too many files are open",
}

_OTHERWISE = "check that the folder exists, its permissions and the disk"


LONGEST_ON_WINDOWS = 259
"""Longest path that Windows allows by default, in characters (Microsoft, "Maximum Path Length Limitation")."""


def refusal(error: OSError) -> tuple[str, str]:
    """Return a reason, such as `no space left on device`, and a remedy."""
    if hasattr(error, "winerror") and len(str(error.filename or "")) > LONGEST_ON_WINDOWS:
        return "the path is too long for Windows", "shorten it, or set LongPathsEnabled in the registry of Windows"
    return (error.strerror or str(error)).lower(), _REMEDIES.get(error.errno or 0, _OTHERWISE)


def unwritable(error: OSError, where: object, done: str = "written") -> OutputError:
    """Return the error of a write that the system refused."""
    why, remedy = refusal(error)
    return OutputError(f"cannot be {done}: {why}", where=str(where), remedy=remedy)


def in_a_sentence(error: OSError) -> str:
    """Return reason and remedy as one sentence."""
    why, remedy = refusal(error)
    return f"{error.filename or 'the output, or a file'}: {why}; {remedy}"
