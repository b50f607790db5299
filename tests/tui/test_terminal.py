"""The command itself on a terminal of its own: drawn, left, the terminal restored."""

from __future__ import annotations

import fcntl
import os
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from functools import partial
from typing import TYPE_CHECKING

import pytest

from dbbstation.files.formats.session import RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from tests.copied import started

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("copies")

PATIENCE_S = 60.0
MAIN_SCREEN_AGAIN = "\x1b[?1049l"
CURSOR_AGAIN = "\x1b[?25h"


class Terminal:
    """A program on a pseudo-terminal of 24 rows and 80 columns."""

    def __init__(self, *arguments: str, **more: str) -> None:
        self._master, slave = os.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.modes = termios.tcgetattr(slave)
        environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"} | more
        words = ["measure", "--rate-hz", "50", *arguments]
        # Python looks at variables for its streams when it starts.
        start = (
            partial(subprocess.Popen, [sys.executable, "-m", "dbbstation", *words]) if more else partial(started, words)
        )
        self.process = start(
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env=environment,
            start_new_session=True,
        )
        self._slave = slave
        self._ends: tuple[int, ...] = (self._master, slave)
        self.shown = ""

    def until(self, text: str) -> None:
        end_s = time.monotonic() + PATIENCE_S
        since = len(self.shown)
        while text not in self.shown[since:]:
            assert time.monotonic() < end_s, f"{text!r} did not come; last: {self.shown[-400:]!r}"
            self._read()

    def press(self, keys: str) -> None:
        os.write(self._master, keys.encode())

    def exit_code(self) -> int:
        end_s = time.monotonic() + PATIENCE_S
        while self.process.poll() is None:
            assert time.monotonic() < end_s, "it does not end"
            self._read()
        while self._read():
            pass
        return self.process.returncode

    def restored(self) -> bool:
        return (
            MAIN_SCREEN_AGAIN in self.shown
            and CURSOR_AGAIN in self.shown
            and termios.tcgetattr(self._slave) == self.modes
        )

    def vanish(self, *, signals: bool) -> None:
        """Go away as a window that is closed: nothing can be written or read; the kernel sends two signals, to a shell perhaps."""
        for end in self._ends:
            os.close(end)
        self._ends = ()
        for number in (signal.SIGHUP, signal.SIGCONT) if signals else ():
            self.process.send_signal(number)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for end in self._ends:
            os.close(end)

    def _read(self) -> bool:
        if not select.select([self._master], [], [], 0.1)[0]:
            return False
        self.shown += os.read(self._master, 65536).decode("utf-8", "replace")
        return True


def of_short_circles(folder: Path) -> tuple[str, ...]:
    """Three times the feed for a third of the samples; at three times real speed, a circle takes as long as one at nine times."""
    text = (shipped_folder("protocols") / "plans" / "ten-minute-check.yaml").read_text("utf-8")
    plan = folder / "plan.yaml"
    plan.write_text(text.replace("feed_mm_min: 1000", "feed_mm_min: 3000"), "utf-8")
    return ("--virtual", "--plan", str(plan), "--time-scale", "3", "--out", str(folder / "session"))


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    opened = Terminal("--virtual", "--time-scale", "3", "--out", str(tmp_path / "session"))
    yield opened
    opened.close()


@pytest.fixture
def of_short(tmp_path: Path) -> Iterator[Terminal]:
    opened = Terminal(*of_short_circles(tmp_path))
    yield opened
    opened.close()


def test_quit_leaves_the_terminal_as_it_was(terminal: Terminal, tmp_path: Path) -> None:
    terminal.until("then press Enter")
    terminal.press("q")
    assert terminal.exit_code() == 0
    assert terminal.restored()
    assert f"{tmp_path / 'session'}: 0 of 6 runs accepted" in terminal.shown


def test_a_terminal_of_another_encoding_is_drawn_on_in_ascii(tmp_path: Path) -> None:
    terminal = Terminal(*of_short_circles(tmp_path), LC_ALL="C")
    try:
        terminal.until("then press Enter")
        terminal.press("\r")
        terminal.until("a verdict")
        terminal.press("q")
        terminal.until("Temperature of the shop now")
        terminal.press("\r")
        assert terminal.exit_code() == 0
    finally:
        terminal.close()
    drawn = terminal.shown.split("\x1b[?1049h", 1)[1].split(MAIN_SCREEN_AGAIN, 1)[0]
    assert drawn.isascii()


@pytest.mark.slow
def test_one_circle_is_measured_and_accepted_wrong_keys_and_all(of_short: Terminal, tmp_path: Path) -> None:
    terminal = of_short
    terminal.until("then press Enter")
    terminal.press("zk7\r")
    terminal.until("touch nothing until it has fed out")
    terminal.press("a5\x1b")  # there is nothing to accept yet
    terminal.until("measures it again")
    terminal.press("a1")  # 1 is a reason, where one is asked for
    terminal.until("low-ccw-1 accepted")
    terminal.press("q")
    terminal.until("Temperature of the shop now")
    terminal.press("21.5\r")
    assert terminal.exit_code() == 0
    assert terminal.restored()
    assert f"{tmp_path / 'session'}: 1 of 6 runs accepted" in terminal.shown
    session = read_session(tmp_path / "session")
    (run,), (note,) = session.runs, session.notes
    assert (run.label, run.state) == ("low ccw 1", RunState.ACCEPTED)
    assert note.ambient_temp_c == 21.5


def test_a_polite_kill_in_mid_circle_keeps_the_recording_and_the_terminal(terminal: Terminal, tmp_path: Path) -> None:
    terminal.until("then press Enter")
    terminal.press("\r")
    terminal.until("touch nothing until it has fed out")
    terminal.process.send_signal(signal.SIGTERM)
    assert terminal.exit_code() == 1
    assert terminal.restored()
    (run,) = read_session(tmp_path / "session").runs
    assert run.state is RunState.RECORDING
    assert run.path.stat().st_size > 1000


@pytest.mark.parametrize(("begun", "signals"), [(False, True), (True, False)], ids=["waiting", "mid-circle, no signal"])
def test_a_terminal_that_vanishes_ends_it_and_the_recording_is_kept(
    terminal: Terminal, tmp_path: Path, *, begun: bool, signals: bool
) -> None:
    terminal.until("then press Enter")
    if begun:
        terminal.press("\r")
        terminal.until("touch nothing until it has fed out")
    terminal.vanish(signals=signals)
    assert terminal.process.wait(PATIENCE_S) == 1
    runs = read_session(tmp_path / "session").runs
    assert [run.state for run in runs] == [RunState.RECORDING] * begun


def test_what_is_wrong_with_the_files_is_said_before_the_screen_opens(tmp_path: Path) -> None:
    opened = Terminal("--virtual", "--plan", str(tmp_path / "none.yaml"))
    try:
        assert opened.exit_code() == 1
        assert "none.yaml" in opened.shown
        assert "\x1b[?1049h" not in opened.shown
    finally:
        opened.close()
