"""The three streams of the program: there from the beginning, and let go of where nobody takes what is written."""

from __future__ import annotations

import os
import sys

from dbbstation.errors import OutputError
from dbbstation.files.refused import refusal
from dbbstation.system.handles import open_nothing

_STREAMS = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))


def open_missing() -> None:
    """Open those that the program was started without, as `>&-` and some schedulers do: onto nothing.

    Otherwise a file that is opened later takes the place of one, and what a library complains of goes into that file.
    """
    for number, (name, mode) in enumerate(_STREAMS):
        try:
            os.fstat(number)
        except OSError:
            opened = open_nothing()  # the lowest number that is free: this one
            os.set_inheritable(opened, True)  # noqa: FBT003 - taken by its place alone
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))


def flush_output() -> None:
    """Bring the output to where it goes.

    Raises:
        BrokenPipeError: nobody reads it any more.
        OutputError: the disk that it goes to refuses.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        why, remedy = refusal(error)
        raise OutputError(f"cannot be written: {why}", where="standard output", remedy=remedy) from error


def drop_unwritable() -> None:
    """Forget output that cannot be written: the interpreter would try again behind the sentence that says what to do."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        drop_output()


def drop_output() -> None:
    """Let the interpreter flush what is left of the output into nothing."""
    os.dup2(open_nothing(), sys.stdout.fileno())
