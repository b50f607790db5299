"""Commands as processes that are copies of one process, which has imported what they need: each import of their own takes seconds.

For tests that need a process of its own to stop, kill or talk to. What a process does while it starts is tested with `subprocess`.
"""

from __future__ import annotations

import functools
import gc
import os
import pickle
import runpy
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing.connection import Connection, wait
from pathlib import Path

LOADED = (
    "dbbstation.demo.loaded",
    "dbbstation.cli.measure",
    "dbbstation.cli.measure_talk",
    "dbbstation.cli.instruments",
    "dbbstation.cli.on_screen",
    "dbbstation.tui.app",
    "dbbstation.service.runner",
)

_CAN = hasattr(os, "fork") and "DBBSTATION_AS_ON_WINDOWS" not in os.environ


class Copy(subprocess.Popen):
    """`subprocess.Popen` of the words of a command behind `python -m dbbstation`."""

    def _execute_child(self, args, executable, preexec_fn, close_fds, pass_fds, cwd, env, *more):  # noqa: ARG002
        inputs = more[3:9]  # behind startupinfo, creationflags and shell: each pipe's end of the child, and ours
        ends = [own if own >= 0 else number for number, own in enumerate((inputs[0], inputs[3], inputs[5]))]
        self.pid = _original().begin(
            list(map(str, args)), str(cwd or Path.cwd()), dict(env or os.environ), ends, alone=more[14]
        )
        self._child_created = True
        self._close_pipe_fds(*inputs)

    def _internal_poll(self, *_args, **_named):
        if self.returncode is None:
            self.returncode = _original().code_of(self.pid, 0.0)
        return self.returncode

    def _wait(self, timeout):
        if self.returncode is None:
            self.returncode = _original().code_of(self.pid, timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired(self.args, timeout)
        return self.returncode


def started(words, **named) -> subprocess.Popen:
    """Start `python -m dbbstation WORDS` with streams in UTF-8; further arguments are those of `subprocess.Popen`."""
    return (
        Copy(words, **named)
        if _CAN
        else subprocess.Popen([sys.executable, "-m", "dbbstation", *map(str, words)], **named)
    )


def done(words, *, typed="", timeout=120.0, **named) -> subprocess.CompletedProcess:
    """Run `python -m dbbstation WORDS` to its end, as `subprocess.run` does, and capture its outputs as text."""
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with started(words, text=True, **pipes, **named) as process:
        try:
            out, said = process.communicate(typed, timeout)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(words, process.returncode, out, said)


class _Original:
    """The process that is copied."""

    def __init__(self) -> None:
        self._line, there = socket.socketpair()
        command = [sys.executable, "-m", __name__, str(there.fileno())]
        self._process = subprocess.Popen(command, pass_fds=[there.fileno()], stdin=subprocess.DEVNULL)
        there.close()
        self._told = Connection(os.dup(self._line.fileno()), writable=False)
        self._codes: dict[int, int] = {}

    def close(self) -> None:
        self._line.close()
        self._told.close()
        self._process.wait()

    def begin(self, words, folder, environment, ends, *, alone) -> int:
        asked = pickle.dumps((words, folder, environment, alone))
        socket.send_fds(self._line, [len(asked).to_bytes(4, "big")], ends)
        self._line.sendall(asked)
        while (begun := self._next()) is None:
            pass
        return begun

    def code_of(self, pid, timeout):
        """Exit code of a copy; None while it runs."""
        while pid not in self._codes and self._told.poll(timeout):
            self._next()
        return self._codes.get(pid)

    def _next(self):
        """Number of a copy that begins; None where one ended."""
        pid, code = self._told.recv()
        if code is None:
            return pid
        self._codes[pid] = code
        return None


@functools.cache
def _original() -> _Original:
    return _Original()


@contextmanager
def kept_loaded():
    """Start the process that is copied; it ends, and its processor time counts, at the end."""
    if _CAN:
        _original()
    yield
    if _CAN:
        _original().close()
        _original.cache_clear()


def _serve(line: socket.socket) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _warm_up()
    gc.collect()
    gc.freeze()
    tell, running = Connection(os.dup(line.fileno()), readable=False), {}
    while True:
        for ready in wait([line, *running]):
            if ready is not line:
                pid = running.pop(ready)
                os.close(ready)
                tell.send((pid, os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])))
            elif (asked := _asked(line)) is None:
                for pid in running.values():
                    os.kill(pid, signal.SIGKILL)
                    os.waitpid(pid, 0)
                return
            else:
                pid = os.fork()
                if not pid:
                    for one in (line.fileno(), tell.fileno(), *running):
                        os.close(one)
                    _become(*asked)
                for end in asked[0]:
                    os.close(end)
                running[os.pidfd_open(pid)] = pid
                tell.send((pid, None))


def _warm_up() -> None:
    """Import, and load the compiled loops that judge a circle."""
    for name in LOADED:
        import_module(name)
    from dbbstation.files.places import shipped_folder  # noqa: PLC0415 - of the copied process alone
    from dbbstation.files.recordings.judged import circles_of_plan  # noqa: PLC0415
    from dbbstation.files.recordings.session import read_session  # noqa: PLC0415
    from dbbstation.station.assembly import check_plan  # noqa: PLC0415

    session = read_session(shipped_folder("fixtures") / "sessions" / "small")
    check_plan(session.plan, session.machine, file="plan.yaml")
    circles_of_plan(session, None)


def _asked(line: socket.socket):
    """Return the ends of three pipes, the words, the folder and the environment of a request; None behind the last."""
    size, ends, *_ = socket.recv_fds(line, 4, 3)
    asked = b""
    while len(asked) < int.from_bytes(size, "big"):
        asked += line.recv(int.from_bytes(size, "big") - len(asked))
    return (ends, *pickle.loads(asked)) if size else None  # noqa: S301 - written above


def _become(ends, words, folder, environment, alone) -> None:
    code = 1
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        for number, end in enumerate(ends):
            os.dup2(end, number)
            os.close(end)
        if alone:
            os.setsid()
        # As Python opens them: by lines to a terminal.
        sys.stdin = sys.__stdin__ = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stdout = sys.__stdout__ = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stderr = sys.__stderr__ = open(  # noqa: SIM115
            2, "w", buffering=1, encoding="utf-8", errors="backslashreplace", closefd=False
        )
        sys.argv[1:] = words
        runpy.run_module("dbbstation", run_name="__main__", alter_sys=True)
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:  # noqa: BLE001 - printed as Python does at the end of a program
        sys.excepthook(*sys.exc_info())
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))
