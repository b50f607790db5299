#!/usr/bin/python3
"""The "screen" of a LinuxCNC that has none: homes, goes to where the program begins, runs it, records every servo cycle.

LinuxCNC starts it as its DISPLAY, in the folder of the run, with the system's Python, which has the module `linuxcnc`.
It reads `start.txt` (X, Y, Z, A, B and C) and `program.ngc`; it writes `samples.txt` (what `halsampler -t` prints) and `ended.txt`,
which holds "ended" or what went wrong.

A planner whose queue runs empty between two moves stops there, and blends with a move that it has begun already; both are
wrong by themselves and say nothing of the program. The clock may run too fast for the interpreter, so this is looked for.
"""

import pathlib
import subprocess
import sys
import time

import linuxcnc

HERE = pathlib.Path(__file__).resolve().parent
PATIENCE_S = 20.0
"""For everything but the program itself."""

FILLED, EMPTY = 20, 2
"""Moves in the planner's queue: more than the first, and it has begun to follow a path; no more than the second, and it runs out."""

BEHIND = "the interpreter fell behind the planner"

WAITS = {linuxcnc.EXEC_WAITING_FOR_MOTION, linuxcnc.EXEC_WAITING_FOR_MOTION_AND_IO, linuxcnc.EXEC_WAITING_FOR_DELAY}

command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()


def until(reached, what):
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        status.poll()
        if reached():
            return
        time.sleep(0.005)
    raise RuntimeError(f"{what} took too long")


def idle():
    return status.interp_state == linuxcnc.INTERP_IDLE and status.queue == 0 and status.inpos


def refused():
    told = errors.poll()
    return "" if told is None or told[0] in {linuxcnc.OPERATOR_TEXT, linuxcnc.OPERATOR_DISPLAY} else str(told[1])


class Queue:
    """Whether the planner's queue runs out although the program goes on."""

    def __init__(self):
        self.filled = False

    def look(self):
        # Before dwells and stops, and at the end of the program, the queue empties as it should.
        if status.exec_state in WAITS or status.interp_state != linuxcnc.INTERP_READING:
            self.filled = False
        elif status.queue > FILLED:
            self.filled = True
        elif self.filled and status.queue <= EMPTY:
            raise RuntimeError(BEHIND)


def prepare():
    command.state(linuxcnc.STATE_ESTOP_RESET)
    command.wait_complete()
    command.state(linuxcnc.STATE_ON)
    command.wait_complete()
    for joint in range(6):
        command.home(joint)
    until(lambda: all(status.homed[:6]), "homing")
    command.mode(linuxcnc.MODE_MDI)
    command.wait_complete()
    block = (HERE / "start.txt").read_text()
    command.mdi("G21 G90 G0 " + block)
    wanted = [float(word[1:]) for word in block.split()]
    until(
        lambda: idle() and max(abs(a - b) for a, b in zip(status.actual_position, wanted, strict=False)) < 1e-5,
        "going to the start",
    )


def run():
    command.mode(linuxcnc.MODE_AUTO)
    command.wait_complete()
    command.program_open(str(HERE / "program.ngc"))
    with (HERE / "samples.txt").open("w") as samples:
        sampler = subprocess.Popen(["halsampler", "-t"], stdout=samples)  # noqa: S607 - as LinuxCNC has it
        subprocess.run(["halcmd", "setp", "sampler.0.enable", "1"], check=True)  # noqa: S607 - likewise
        command.auto(linuxcnc.AUTO_RUN, 0)
        # `wait_complete` would wait for the program.
        until(lambda: status.interp_state != linuxcnc.INTERP_IDLE, "starting the program")
        queue = Queue()
        while True:
            status.poll()
            if idle():
                break
            queue.look()
            if status.paused or status.interp_state == linuxcnc.INTERP_PAUSED:
                command.auto(linuxcnc.AUTO_RESUME)
            fault = refused()
            if fault:
                raise RuntimeError(fault)
            time.sleep(0.001)
        time.sleep(0.2)
        sampler.terminate()
        sampler.wait()


try:
    prepare()
    run()
    said = "ended"
except RuntimeError as error:
    said = str(error)
(HERE / "ended.txt").write_text(said)
sys.exit(0)
