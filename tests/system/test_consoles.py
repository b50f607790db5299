"""Consoles that do not have every letter: what they have is printed, nothing fails, and a pipe of the same encoding likewise."""

from __future__ import annotations

import functools
import os
import subprocess
import sys

import pytest

from dbbstation.files.places import shipped_folder

SMALL = shipped_folder("fixtures") / "sessions" / "small"


@functools.cache
def in_unicode(*command):
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8", "PYTHONUTF8": "0"}
    return subprocess.run(command, env=environment, capture_output=True, check=False).stdout.decode("utf-8")


@pytest.mark.parametrize(
    ("words", "encoding"),
    [
        *((("session", "list"), encoding) for encoding in ("cp1252", "cp437", "ascii")),
        (("circles",), "cp1252"),
        *(pytest.param(("circles",), encoding, marks=pytest.mark.nightly) for encoding in ("cp437", "ascii")),
    ],
)
def test_every_console_gets_the_table(encoding, words):
    """Python writes to a Windows console in Unicode, to a pipe or file in the code page of the system."""
    environment = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    command = [sys.executable, "-m", "dbbstation", *words, str(SMALL)]
    done = subprocess.run(command, env=environment, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert b"Traceback" not in done.stderr
    shown, wanted = done.stdout.decode("utf-8" if encoding == "ascii" else encoding), in_unicode(*command)
    assert len(shown.splitlines()) == len(wanted.splitlines())
    assert [letter for letter in wanted if letter.isascii()] == [
        letter for letter in shown if letter.isascii() and letter != "?"
    ]
    if encoding != "ascii":
        assert ("µ" in shown) == ("µ" in wanted)
