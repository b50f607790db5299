"""Terminals without UTF-8, and a Linux console without braille: other characters, the same layout."""

from __future__ import annotations

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

from dbbstation.tui.braille import BLANK
from dbbstation.tui.plain_terminal import plain, plain_driver, without_braille


class Usual:
    wrote = ""

    def write(self, data: str) -> None:
        self.wrote += data


@pytest.mark.parametrize(
    ("encoding", "term", "written"),
    [
        ("utf-8", "xterm-256color", "┌ 12 µm ⣿⠁⠀ █"),
        ("utf-8", "linux", "┌ 12 µm *.  █"),
        ("iso-8859-1", "xterm", "+ 12 um *.  #"),
        ("ascii", "dumb", "+ 12 um *.  #"),
    ],
)
def test_what_a_terminal_is_written(monkeypatch: pytest.MonkeyPatch, encoding: str, term: str, written: str) -> None:
    monkeypatch.setattr(sys, "__stderr__", SimpleNamespace(encoding=encoding))
    monkeypatch.setenv("TERM", term)
    driver = plain_driver(Usual)()
    driver.write("┌ 12 µm ⣿⠁⠀ █")
    assert driver.wrote == written


@pytest.mark.parametrize(
    ("locale", "ascii_only"),
    [
        ({"LANG": "de_DE.ISO-8859-1"}, True),
        ({"LC_ALL": "C"}, True),
        ({"LANG": "C"}, True),
        ({"LANG": "C.UTF-8"}, False),
        ({}, False),
        ({"LANG": "C", "LC_ALL": "en_US.UTF-8"}, False),
        ({"LANG": "C", "PYTHONUTF8": "1"}, False),
    ],
)
def test_a_locale_that_python_lacks_is_not_taken_for_utf_8(locale: dict[str, str], *, ascii_only: bool) -> None:
    """Python takes UTF-8 there, in its own process: asked of a new one."""
    code = "from dbbstation.tui.plain_terminal import plain_driver as p; print(p(object) is not object)"
    names = {name: value for name, value in os.environ.items() if name not in {"LANG", "LC_ALL", "LC_CTYPE"}}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**names, "TERM": "xterm", **locale},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout.strip() == "True") is ascii_only


def test_each_character_stays_one() -> None:
    every = "".join(map(chr, range(0xA0, 0x2900)))
    assert len(plain(every)) == len(every)
    assert plain(every).isascii()
    assert plain("▶ ✓ – ° ─ │ é") == "> V - o - | e".replace("V", "v")
    # The more dots, the darker.
    assert without_braille("".join(chr(BLANK + bits) for bits in (0, 1, 0x0F, 0xFF))) == " .:*"
