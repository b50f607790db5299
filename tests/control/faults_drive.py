#!/usr/bin/python3
"""The "screen" of a LinuxCNC whose kinematics is made to fault: does the steps of `program.ngc`, a line each.

A line is `setp PIN VALUE`, `on`, `jog AXIS SPEED` until motion ends, or an MDI block. Writes `told.json`: after each step the component's fault, whether motion is enabled,
and what LinuxCNC said; and `samples.txt` with the joints of all servo cycles.
"""

import json
import pathlib
import subprocess
import sys
import time

import linuxcnc

HERE = pathlib.Path(__file__).resolve().parent
PATIENCE_S = 20.0
KINS = next(
    line.split("=")[1].strip() for line in (HERE / "planner.ini").read_text().splitlines() if "KINEMATICS" in line
)
command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()


def until(reached):
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        status.poll()
        if reached():
            return True
        time.sleep(0.005)
    return False


def halcmd(*words):
    return subprocess.run(["halcmd", *words], check=True, capture_output=True, text=True).stdout.strip()  # noqa: S607


def on():
    for state in (linuxcnc.STATE_ESTOP_RESET, linuxcnc.STATE_ON):
        command.state(state)
        command.wait_complete()
    until(lambda: status.enabled)
    command.mode(linuxcnc.MODE_MDI)
    command.wait_complete()


def moved(block):
    command.mdi(block)
    time.sleep(0.1)
    until(
        lambda: (
            not status.enabled or (status.interp_state == linuxcnc.INTERP_IDLE and status.inpos and not status.queue)
        )
    )


def jogged(axis, speed):
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    command.teleop_enable(1)
    until(lambda: status.motion_mode == linuxcnc.TRAJ_MODE_TELEOP)
    command.jog(linuxcnc.JOG_CONTINUOUS, 0, "XYZABC".index(axis), speed)
    until(lambda: not status.enabled)


def said():
    found = []
    while (told := errors.poll()) is not None:
        found.append(str(told[1]))
    return found


told = []
on()
for joint in range(6):
    command.home(joint)
homed = until(lambda: all(status.homed[:6]))
command.mode(linuxcnc.MODE_MDI)
command.wait_complete()
with (HERE / "samples.txt").open("w") as samples:
    sampler = subprocess.Popen(["halsampler", "-t"], stdout=samples)  # noqa: S607
    halcmd("setp", "sampler.0.enable", "1")
    for step in (HERE / "program.ngc").read_text().splitlines():
        if step.startswith("setp"):
            _, pin, value = step.split()
            halcmd("setp", f"{KINS}.{pin}", value)
            time.sleep(0.3)
        elif step == "on":
            on()
        elif step.startswith("jog"):
            _, axis, speed = step.split()
            jogged(axis, float(speed))
        else:
            moved(step)
        status.poll()
        fault = int(halcmd("getp", f"{KINS}.fault"), 0)
        told.append({"step": step, "fault": fault, "enabled": bool(status.enabled), "said": said()})
    time.sleep(0.2)
    sampler.terminate()
    sampler.wait()
(HERE / "told.json").write_text(json.dumps({"homed": homed, "steps": told}))
sys.exit(0)
