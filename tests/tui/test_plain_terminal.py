"""Terminals without UTF-8, and a Linux console without braille: other characters, the same layout."""

from __future__ import annotations

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


def test_each_character_stays_one() -> None:
    every = "".join(map(chr, range(0xA0, 0x2900)))
    assert len(plain(every)) == len(every)
    assert plain(every).isascii()
    assert plain("▶ ✓ – ° ─ │ é") == "> V - o - | e".replace("V", "v")
    # The more dots, the darker.
    assert without_braille("".join(chr(BLANK + bits) for bits in (0, 1, 0x0F, 0xFF))) == " .:*"
