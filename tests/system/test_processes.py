"""Work in processes of its own: results, faults, processes that die, and no process left behind."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from dbbstation.system.processes import each

PID = "__import__('os').getpid()"
IN_CHILD = "__import__('multiprocessing').parent_process()"


def none_left():
    """Whether the processes end within a minute; they were told to a moment ago.

    Asked again and again: the pool's own thread waits for the same processes. Where it was the first to hear of an end and has
    not noted it yet, a single look still counts that process.
    """
    given_up_s = time.monotonic() + 60.0
    while multiprocessing.active_children():
        if time.monotonic() > given_up_s:
            return False
        time.sleep(0.02)
    return True


def test_one_process_works_here_and_in_order():
    assert list(each(eval, [PID, "2", "3"], 1)) == [(0, os.getpid()), (1, 2), (2, 3)]


def test_several_work_elsewhere_and_say_which_item_is_done():
    found = dict(each(eval, [PID, "1 + 1", "'three'"], 2))
    assert found.pop(0) != os.getpid()
    assert found == {1: 2, 2: "three"}


def test_a_fault_is_raised_here_and_ends_them():
    with pytest.raises(ZeroDivisionError):
        list(each(eval, ["1 / 0", "__import__('time').sleep(1000)"], 2))
    assert none_left()


def test_what_a_dead_process_leaves_is_worked_out_here():
    assert dict(each(eval, [f"__import__('os')._exit(9) if {IN_CHILD} else 7", "8"], 2)) == {0: 7, 1: 8}


SLEEPS = """
from dbbstation.system.processes import each
if __name__ == "__main__":
    for place, process in each(eval, ["__import__('os').getpid()", "__import__('time').sleep(1000)"], 2):
        print(process, flush=True)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="what a process does stands in /proc")
def test_a_kill_of_the_one_that_started_them_ends_them(tmp_path):
    script = tmp_path / "sleeps.py"
    script.write_text(SLEEPS, encoding="utf-8")
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        child = int(process.stdout.readline())
        process.kill()
    given_up_s = time.monotonic() + 60.0
    while Path(f"/proc/{child}").exists() and "Z (zombie)" not in Path(f"/proc/{child}/status").read_text("ascii"):
        assert time.monotonic() < given_up_s
        time.sleep(0.02)


def test_work_that_is_given_up_leaves_no_process():
    with closing(each(eval, ["1", "__import__('time').sleep(1000)"], 2)) as found:
        assert next(found) == (0, 1)
    assert none_left()
