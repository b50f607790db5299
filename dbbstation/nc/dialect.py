"""Write and read a toolpath in the language of a control."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar
from unicodedata import normalize

from dbbstation.errors import InputError, StationError
from dbbstation.nc.spilled import LongText
from dbbstation.nc.toolpath import DECIMALS, joined

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Rotation
    from dbbstation.nc.planner import LookAhead
    from dbbstation.nc.setup import ControlSetup
    from dbbstation.nc.toolpath import Toolpath

    Head = Callable[[], tuple[Sequence[str], tuple[int, ...]]]


COMPENSATED = "compensated, greatest correction"
"""Text in the header of a compensated program."""

LONGEST_COMMENT = 200
"""LinuxCNC refuses lines of more than 252 characters; other controls have shorter comments, and cut them."""


def plain(text: str) -> str:
    """Return text on one line of printable ASCII, cut to a comment's length."""
    ascii_text = normalize("NFKC", text).replace("μ", "u").encode("ascii", "replace").decode()
    printable = "".join(letter if letter.isprintable() else " " for letter in ascii_text)
    return printable[:LONGEST_COMMENT].strip()


def already_compensated(name: str, how: str) -> StationError:
    """Return the error for a compensated program."""
    remedy = "compensate the nominal program that it was made from"
    return StationError(f"this program is compensated already, {how}", where=name, remedy=remedy)


def says_compensated(path: Toolpath) -> bool:
    """Return whether a comment has the letters of `COMPENSATED`, whatever alphabet it was written in."""
    only, letters = re.compile("[^a-z]"), COMPENSATED.replace(",", "").replace(" ", "")
    return any(only.sub("", text.lower()).startswith(letters) for text in path.text.values())


class Dialect(ABC):
    """The language of one control, without state. Each dialect has a file in `dialects/`."""

    name: ClassVar[str]
    extension: ClassVar[str]
    """Of its program files, with the dot."""
    also_read: ClassVar[Sequence[str]] = ()
    """Other endings of programs that it reads."""
    what: ClassVar[str]
    """The control, in one line."""
    look_ahead: ClassVar[LookAhead | None] = None
    """How far the control looks ahead in moves that turn A, B or C; None: unknown, so that feeds are not checked."""
    takes_setup: ClassVar[bool] = False
    takes_text: ClassVar[bool] = False
    """Whether `read` takes a `LongText`, too, which may be longer than memory."""
    decimals: ClassVar[Sequence[int]] = DECIMALS
    """Decimals of X, Y, Z [mm], A, B, C [deg] for the mark and the check of compensated programs."""
    rotation: ClassVar[Rotation | None] = None
    """Order in which the control turns by A, B and C; None: the machine's."""

    @abstractmethod
    def write(self, toolpath: Toolpath, header: Sequence[str] = ()) -> str:
        """Return the program, with the header's lines as comments first.

        The same toolpath and header give the same text. The first line without comment contains `numbers`.
        `toolpath.name` and `toolpath.run` identify the program, if a control needs a name or number.
        """

    def write_parts(self, parts: Iterable[Toolpath], head: Head) -> LongText:
        """Return the program of a toolpath in parts; `head` returns header and `numbers` once all parts are made."""
        toolpath = joined(list(parts))
        header, numbers = head()
        return LongText.of(self.write(replace(toolpath, numbers=numbers), header))

    name_letters: ClassVar[str] = r"\s\S"
    """Letters that a program's name may have, as in brackets of a regular expression; others become underscores."""
    longest_name: ClassVar[int] = 200
    """Greatest number of letters in a program's name, without its extension."""

    def file_name(self, stem: str, run: int) -> str:
        """Return the name of a program's file; `run` is its number among the programs that are written together, from 1. A name that is cut ends with this number."""
        name, number = re.sub(f"[^{self.name_letters}]", "_", stem.removesuffix(self.extension)), f"_{run}"
        if len(name) > self.longest_name:
            name = name[: self.longest_name - len(number)] + number
        return name + self.extension

    def is_in(self, text: str) -> bool:  # noqa: ARG002
        """Return whether a program may be in this language. The program asks this if several dialects share a file ending."""
        return True

    @abstractmethod
    def read(self, text: str, name: str, *, start: Floats | None = None, setup: ControlSetup | None = None) -> Toolpath:
        """Return the toolpath that a program commands.

        Args:
            start: pose before the program, shape (6,) [mm, deg], NaN for unknown axes; None: all unknown.
            setup: offsets and tool lengths of the control, for a dialect that `takes_setup`; None: all zero.

        Raises:
            InputError: faults with line and column.
        """

    def toolpath(
        self, text: str | LongText, name: str, *, start: Floats | None = None, setup: ControlSetup | None = None
    ) -> Toolpath:
        """Return the result of `read` for a program with moves.

        Raises:
            InputError: as `read`, or nothing moves.
            StationError: a setup for a dialect that takes none, or a compensated program whose own check of offsets
                ends it.
        """
        declared = {} if setup is None else {"setup": setup}
        if declared and not self.takes_setup:
            what = f"the dialect {self.name} takes no offsets, tool lengths or files of the control"
            raise StationError(what, where=name, remedy="leave them out, or post the program in machine coordinates")
        given: Any = text if self.takes_text else str(text)
        path = replace(self.read(given, name, start=start, **declared), rotation=self.rotation)
        if path.first_move is None:
            if says_compensated(path):
                raise already_compensated(name, "says its header")
            remedy = "check that it is the file you mean: subprograms move only if a program calls them"
            raise InputError.of(name, "this program moves nothing", remedy)
        return path
