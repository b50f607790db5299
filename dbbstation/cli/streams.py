"""The three standard streams: opened if missing, dropped if unwritable."""

from __future__ import annotations

import os
import sys

from dbbstation.errors import OutputError
from dbbstation.files.refused import refusal
from dbbstation.system.handles import open_nothing

_STREAMS = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))


def open_missing() -> None:
    """Open missing streams on the null device, so that no later file replaces them."""
    for number, (name, mode) in enumerate(_STREAMS):
        try:
            os.fstat(number)
        except OSError:
            opened = open_nothing()  # the lowest number that is free: this one
            os.set_inheritable(opened, True)  # noqa: FBT003 - taken by its place alone
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))


def flush_output() -> None:
    """Flush the output.

    Raises:
        BrokenPipeError: its reader is gone.
        OutputError: its disk refuses.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        why, remedy = refusal(error)
        raise OutputError(f"cannot be written: {why}", where="standard output", remedy=remedy) from error


def drop_unwritable() -> None:
    """Discard unwritable output, which the interpreter would retry."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        drop_output()


def drop_output() -> None:
    """Flush remaining output into nothing."""
    os.dup2(open_nothing(), sys.stdout.fileno())
