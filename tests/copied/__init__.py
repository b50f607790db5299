"""Commands as processes that are copies of one process, which has imported what they need: each import of their own takes seconds.

For tests that need a process of its own to stop, kill or talk to. What a process does while it starts is tested with `subprocess`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

from dbbstation.system.copies import copied_process

ROOT = Path(__file__).parents[2]

_kept = [None]


class Copy(subprocess.Popen):
    """`subprocess.Popen` of a module of the program and its words, or of Python that runs it by `-m`."""

    def _execute_child(self, args, executable, preexec_fn, close_fds, pass_fds, cwd, env, *more):  # noqa: ARG002
        inputs = more[3:9]  # behind startupinfo, creationflags and shell: each pipe's end of the child, and ours
        streams = [own if own >= 0 else number for number, own in enumerate((inputs[0], inputs[3], inputs[5]))]
        self._copied = _kept[-1]
        module = args[args.index("-m") + 1 :] if args[0] == sys.executable else args
        words = [json.dumps(dict(env or os.environ)), "alone" if more[14] else "", *map(str, module)]
        self.pid = self._copied.begin(words, cwd or Path.cwd(), streams)
        self._child_created = True
        self._close_pipe_fds(*inputs)

    def _internal_poll(self, *_args, **_named):
        if self.returncode is None:
            self.returncode = self._copied.code_of(self.pid, 0.0)
        return self.returncode

    def _wait(self, timeout):
        if self.returncode is None:
            self.returncode = self._copied.code_of(self.pid, timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired(self.args, timeout)
        return self.returncode


def started(words, **named) -> subprocess.Popen:
    """Start `python -m dbbstation WORDS` with streams in UTF-8; further arguments are those of `subprocess.Popen`."""
    return (
        subprocess.Popen([sys.executable, "-m", "dbbstation", *map(str, words)], **named)
        if _kept[-1] is None
        else Copy(["dbbstation", *words], **named)
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


_WITH_COPIES = SimpleNamespace(Popen=Copy, PIPE=subprocess.PIPE, TimeoutExpired=subprocess.TimeoutExpired)


def copied_works(patch):
    """Let the works of the screen be copies, too."""
    if _kept[-1] is not None:
        patch.setattr("dbbstation.service.work.subprocess", _WITH_COPIES)


@contextmanager
def kept_loaded():
    """Keep the process that is copied, where one can be; it ends, and its processor time counts, at the end."""
    with ExitStack() as stack:
        with patch.dict(os.environ, PYTHONPATH=str(ROOT)):
            _kept.append(stack.enter_context(copied_process("tests.copied", "tests.copied.loaded")))
        yield
        _kept.pop()
