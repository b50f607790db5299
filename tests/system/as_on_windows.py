"""Run by `test_windows.py` in a process that has what Windows has: what `sitecustomize` takes away is away, and circles are recorded."""

from __future__ import annotations

import socket
import subprocess
import threading
import time
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import OutputError
from dbbstation.files.recordings.lock import SessionLock
from dbbstation.files.recordings.session import read_session
from dbbstation.instrument.library import load_instrument
from dbbstation.service.held_line import probe
from dbbstation.system import handles, pseudo_terminal, replacing, signals
from tests.copied import done, started
from tests.station.bench import STREAM, bench, lines_of, wait_for

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PLAN = """\
format: dbb-plan/1
name: one-circle
path: {radius_mm: 150.0, feed_mm_min: 1000, start_deg: 0, overshoot_deg: 45, feed_in_mm: 1.5, directions: [ccw]}
jig: {bores: {9: [0, 0]}, origin_in_machine_mm: [0, 0, -1150]}
holders: {short: {repeatability_um: 0.58}}
balls: {9-short: {bore: 9, holder: short, centre_mm: [0.0, 0.0, 0.0], uncertainty_um: 0.8}}
tests: [{name: a, ball: 9-short}]
"""


def test_the_program_sees_what_windows_has() -> None:
    space: dict[str, object] = {"__name__": "dbbstation.anything"}
    exec("import os, signal, select", space)  # noqa: S102 - as a module of the program
    for module, gone, there in (
        ("os", "pread", "lseek"),
        ("os", "O_CLOEXEC", "O_BINARY"),
        ("os", "killpg", "kill"),
        ("signal", "SIGHUP", "SIGTERM"),
        ("select", "poll", "select"),
    ):
        assert not hasattr(space[module], gone)
        assert hasattr(space[module], there)
    with pytest.raises(ModuleNotFoundError):
        exec("import fcntl", space)  # noqa: S102 - the same
    assert not handles.HAS_FLOCK
    assert not pseudo_terminal.HAS_PTY
    assert signals.CLOSED == ()


def test_an_open_file_is_neither_replaced_nor_deleted(tmp_path: Path) -> None:
    path, new = tmp_path / "a", tmp_path / "b"
    path.write_text("old", encoding="utf-8")
    new.write_text("new", encoding="utf-8")
    with path.open(encoding="utf-8"):
        for act in (lambda: new.replace(path), path.unlink, lambda: path.rename(tmp_path / "c")):
            with pytest.raises(PermissionError):
                act()
    path.chmod(0o444)
    with pytest.raises(PermissionError):
        path.unlink()
    with pytest.raises(OSError, match="Invalid argument"):
        (tmp_path / "10:30.csv").write_text("", encoding="utf-8")


def test_a_file_that_a_scanner_holds_for_a_second_is_replaced_after_it(tmp_path: Path) -> None:
    path, new = tmp_path / "a", tmp_path / "b"
    path.write_text("old", encoding="utf-8")
    new.write_text("new", encoding="utf-8")
    held = path.open(encoding="utf-8")
    threading.Timer(1.0, held.close).start()
    replacing.replace(new, path)
    assert path.read_text(encoding="utf-8") == "new"


def test_a_file_that_may_only_be_read_is_replaced_and_removed(tmp_path: Path) -> None:
    path, new = tmp_path / "a", tmp_path / "b"
    for content in ("old", "new"):
        (path if content == "old" else new).write_text(content, encoding="utf-8")
    path.chmod(0o444)
    replacing.replace(new, path)
    assert path.read_text(encoding="utf-8") == "new"
    path.chmod(0o444)
    replacing.remove(path)
    assert not path.exists()


def test_two_locks_on_one_session_exclude_each_other(tmp_path: Path) -> None:
    with SessionLock(tmp_path) as first:
        assert first.held
        with pytest.raises(OutputError, match="writes into this session"):
            SessionLock(tmp_path)
    SessionLock(tmp_path).close()


class Cable:
    """Passes bytes between a port of this computer and an instrument's; can be pulled and plugged in again."""

    def __init__(self, instrument: str) -> None:
        host, port = instrument.removeprefix("socket://").split(":")
        self._instrument = (host, int(port))
        self._server = socket.create_server((host, 0))
        self._server.settimeout(0.05)
        self.port = f"socket://{host}:{self._server.getsockname()[1]}"
        self.plugged = threading.Event()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._over.is_set():
            with suppress(TimeoutError):
                near, _ = self._server.accept()
                with near:
                    if self.plugged.is_set():
                        with socket.create_connection(self._instrument) as far:
                            self._carry(near, far)

    def _carry(self, near: socket.socket, far: socket.socket) -> None:
        for one in (near, far):
            one.settimeout(0.005)
        while self.plugged.is_set() and not self._over.is_set():
            for source, target in ((near, far), (far, near)):
                with suppress(TimeoutError):
                    try:
                        data = source.recv(4096)
                        target.sendall(data)
                    except ConnectionError:
                        return
                    if not data:
                        return

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self._server.close()


@contextmanager
def cable_to(instrument: str) -> Iterator[Cable]:
    cable = Cable(instrument)
    try:
        yield cable
    finally:
        cable.close()


def test_plug_in_find_the_port_record_pull_the_cable_go_on(tmp_path: Path) -> None:
    plan_file, out = tmp_path / "plan.yaml", tmp_path / "session"
    plan_file.write_text(PLAN, encoding="utf-8")
    part = out / "runs" / "a-ccw-1.csv.part"
    with bench(plan_file, scale=30.0) as place, cable_to(place.wire.port) as cable:
        assert place.wire.port.startswith("socket://")
        assert not probe(load_instrument(STREAM), cable.port, patience_s=1.0).answers
        cable.plugged.set()
        wait_for(lambda: probe(load_instrument(STREAM), cable.port, patience_s=1.0).answers)
        command = [cable.port if word == place.wire.port else word for word in place.command(out)]
        with started(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
            wait_for(lambda: lines_of(part) > 200, process)
            cable.plugged.clear()
            time.sleep(0.3)
            cable.plugged.set()
            _, said = process.communicate(timeout=60.0)
        kept = part.read_bytes() if part.exists() else b""
        if process.returncode != 0:
            again = done(command, timeout=60.0)
            assert again.returncode == 0, again.stderr
    assert "Traceback" not in said
    session = read_session(out)
    assert session.runs[-1].state.value == "accepted"
    if kept:
        assert part.read_bytes() == kept
