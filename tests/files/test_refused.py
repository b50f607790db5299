"""What refusals of the system and files of other kinds are called."""

from __future__ import annotations

import errno

from dbbstation.errors import LONGEST_ON_WINDOWS, refusal
from dbbstation.files.recordings.foreign_csv import kind_of


def test_a_path_that_windows_does_not_allow_is_named():
    error = OSError(errno.ENOENT, "No such file or directory", (LONGEST_ON_WINDOWS + 1) * "x")
    assert refusal(error)[0] == "no such file or directory"
    error.winerror = 3
    assert refusal(error)[0] == "the path is too long for Windows"


def test_zero_bytes_are_no_text():
    assert kind_of(b"t_s,length_mm\n\0\0\0") == (
        "this is no text: it holds zero bytes",
        "export text from the program that made it",
    )
    assert kind_of(b"t_s,length_mm\n") is None
