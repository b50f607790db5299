"""Run LinuxCNC without a screen: a program is the input, the commands of every servo cycle are the output.

This needs the Debian packages `linuxcnc-uspace` and, for a kinematics, `linuxcnc-uspace-dev`. LinuxCNC refuses to run
as root. If root calls this module, it starts LinuxCNC as the user who called sudo, else as the user `nobody`.

LinuxCNC runs in real time. `faster` speeds up its clock: the servo period and all times are divided by it, speeds are
multiplied by it, and accelerations by its square. So the distance and its change in a servo cycle stay the same.
Samples have the times of the usual clock. The interpreter does not use this clock. If it falls behind the planner, the
program runs again with a slower clock.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import StationError
from dbbstation.files.places import shipped_folder
from dbbstation.files.source_text import text_of
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import forward
from dbbstation.machine.travel import middle
from dbbstation.system.children import end_tree, is_root
from dbbstation.system.handles import lock, open_to_change

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

NEEDED = ("linuxcnc", "halsampler", "rtapi_app", "setpriv")
MODULES = Path("/usr/lib/linuxcnc/modules")
"""Folder in which the Debian package looks for modules; rtapi_app allows no other folder."""

NOBODY = "65534"
"""User and group without rights, on any Linux [Debian base-passwd]."""

PERIOD_NS = 1_000_000
"""Servo period at the usual clock."""

GREATEST_MM_S, GREATEST_DEG_S, GREATEST_DEG_S2 = 500.0, 600.0, 10_000.0
"""Speeds of the axes and acceleration of the angles: so large that they limit no program here."""

RAMP_HZ = 100.0
"""LinuxCNC's default of `ARC_BLEND_RAMP_FREQ`: moves that end within its period change speed evenly. It has a separate
clock."""

BEHIND = "the interpreter fell behind the planner"
"""The same text as in `drive.py`."""

PATIENCE_S = 600.0
EVERY = 10
"""Servo cycles between points of a driven path: at 25 mm/s chords of 0.25 mm, 0.05 µm from a circle of 150 mm."""


class BehindError(RuntimeError):
    """The planner's queue ran empty during the program, so that its motion is not what the program commands."""


@dataclass(frozen=True, eq=False)
class PlannerRun:
    """The motion that the planner computed for a program.

    Attributes:
        time_s: of each sample, from the first servo cycle that moves to the last, shape (n,) [s].
        poses: commanded, shape (n, 6) [mm, deg]; with a kinematics driven lengths of the joints [mm].
        line: of the program, shape (n,).
    """

    time_s: Floats
    poses: Floats
    line: NDArray[np.int_]

    @property
    def duration_s(self) -> float:
        """Return the time from the first motion to the last, with dwells and stops [s]."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def moving_s(self) -> float:
        """Return the time in motion [s], without dwells and stops, because their length depends on the load of the computer."""
        return float(np.diff(self.time_s)[np.any(np.diff(self.poses, axis=0) != 0.0, axis=1)].sum())


@dataclass(frozen=True, eq=False)
class ControlKins:
    """A kinematics of LinuxCNC; with it, joints are recorded.

    Attributes:
        home_mm: joints at which the machine is switched on, shape (6,).
        offset_mm: added to HOME and HOME_OFFSET, shape (6,).
        home_z_mm: height at switch-on, upright over the middle; LinuxCNC's search for the pose starts there.
        hal: lines after the one that loads the module.
        tables: text of each joint's `COMP_FILE`; empty for none.
    """

    name: str
    home_mm: Floats
    offset_mm: Floats
    home_z_mm: float
    hal: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()


def missing(*, kinematics: bool = False) -> str:
    """Return why this computer cannot run LinuxCNC or build a kinematics; empty if it can."""
    lacking = [name for name in (*NEEDED, *(["halcompile"] if kinematics else [])) if shutil.which(name) is None]
    if lacking:
        return f"LinuxCNC is not installed here: no {', '.join(lacking)}"
    return "only root installs a kinematics of LinuxCNC" if kinematics and not is_root() else ""


@contextmanager
def installed_component(file: Path) -> Iterator[None]:
    """Build a `.comp` file and install it; remove the module afterwards.

    Raises:
        StationError: halcompile refuses it.
    """
    command = ["halcompile", "--install", file.name]
    with alone():
        done = subprocess.run(command, cwd=file.parent, capture_output=True, text=True, check=False)  # noqa: S603 - LinuxCNC's own
    if done.returncode or "warning" in done.stderr:
        raise StationError((done.stdout + done.stderr).strip(), where=" ".join(command))
    try:
        yield
    finally:
        (MODULES / f"{file.stem}.so").unlink(missing_ok=True)


def run(
    text: str,
    *,
    mm_s2: float = 1000.0,
    faster: int = 1,
    kins: ControlKins | None = None,
) -> PlannerRun:
    """Run a program on the planner, from its first point.

    Args:
        text: the program; its first move names X, Y, Z, A, B and C.
        mm_s2: acceleration of X, Y and Z [mm/s²].
        faster: how many times as fast as usual the clock runs; halved as long as the interpreter falls behind.

    Raises:
        RuntimeError: LinuxCNC refuses the program or does not end.
        BehindError: the interpreter falls behind at the usual clock too.
    """
    while True:
        try:
            return run_once(text, mm_s2, faster, kins)
        except BehindError:
            if faster == 1:
                raise
            faster = max(faster // 2, 1)


def run_once(text: str, mm_s2: float, faster: int, kins: ControlKins | None = None) -> PlannerRun:
    """Run a program with this clock; arguments as for `run`."""
    with started(text, mm_s2, faster, kins) as (folder, printed):
        ended = text_of(folder / "ended.txt") if (folder / "ended.txt").exists() else ""
        if ended == BEHIND:
            raise BehindError(BEHIND)
        if ended != "ended":
            raise RuntimeError(ended or f"LinuxCNC did not start:\n{printed}")
        ran = _read(folder / "samples.txt", PERIOD_NS / 1e9)
        # `motor-pos-cmd` is the joint less its HOME_OFFSET.
        return ran if kins is None else PlannerRun(ran.time_s, ran.poses + kins.home_mm, ran.line)


@contextmanager
def started(
    text: str, mm_s2: float, faster: int, kins: ControlKins | None, *, driver: Path | None = None
) -> Iterator[tuple[Path, str]]:
    """Run LinuxCNC to its end in a new folder; yield the folder and the printed text.

    Args:
        driver: replaces `drive.py`.
    """
    with tempfile.TemporaryDirectory(prefix="dbbstation-planner-") as made, alone():
        folder = Path(made)
        _configure(folder, mm_s2, faster, kins)
        if driver is not None:
            shutil.copy(driver, folder / "drive.py")
        (folder / "drive.py").chmod(0o755)
        (folder / "program.ngc").write_text(_quickened(text, faster), encoding="utf-8")
        (folder / "start.txt").write_text(_first_point(text), encoding="utf-8")
        yield folder, _printed(folder)


def driven_program(machine: Machine, ran: PlannerRun) -> str:
    """Return the program with which a nominal control drives the struts exactly as LinuxCNC did."""
    rows = np.unique([*range(0, len(ran.poses), EVERY), len(ran.poses) - 1])
    start = middle(machine)
    near = Frames(*(np.repeat(of, len(rows), axis=0) for of in (start.position_mm, start.rotation)))
    frames = forward(machine.hexapod, ran.poses[rows] + machine.reference_length_error_mm, near)
    poses, took = frames.to_poses(machine.hexapod.rotation), np.diff(ran.time_s[rows])
    feeds = 60.0 * np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1) / took
    words = [" ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZABC", pose, strict=True)) for pose in poses]
    moves = [f"G1 {to} F{feed:.6f}" for to, feed in zip(words[1:], feeds, strict=True) if feed > 0.0]
    return "\n".join(["%", "G21 G90 G94", f"G0 {words[0]}", *moves, "M2", "%", ""])


def _configure(folder: Path, mm_s2: float, faster: int, kins: ControlKins | None = None) -> None:
    shipped = shipped_folder("fixtures") / "linuxcnc"
    limits = {
        "period_ns": PERIOD_NS // faster,
        "mm_s": GREATEST_MM_S * faster,
        "deg_s": GREATEST_DEG_S * faster,
        "mm_s2": mm_s2 * faster**2,
        "deg_s2": GREATEST_DEG_S2 * faster**2,
        "ramp_hz": RAMP_HZ * faster,
    }
    ini = [text_of(shipped / "planner.ini").format(**limits)]
    if kins is not None:
        ini[0] = ini[0].replace("trivkins coordinates=XYZABC", kins.name)
        ini[0] = ini[0].replace("[TRAJ]\n", f"[TRAJ]\nHOME = 0 0 {kins.home_z_mm} 0 0 0\n")
    for joint, axis in enumerate("XYZABC"):
        kind, unit = ("LINEAR", "mm") if axis in "XYZ" else ("ANGULAR", "deg")
        both = (
            f"MIN_LIMIT = -9999\nMAX_LIMIT = 9999\nMAX_VELOCITY = {limits[unit + '_s']}\n"
            f"MAX_ACCELERATION = {limits[unit + '_s2']}\n"
        )
        homed = (
            "HOME = 0\nHOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 0\nHOME_SEQUENCE = 0\nFERROR = 9999\nMIN_FERROR = 9999\n"
        )
        if kins is not None:
            homed = homed.replace("HOME = 0\n", f"HOME = {kins.home_mm[joint] + kins.offset_mm[joint]:.9f}\n")
            homed += f"HOME_OFFSET = {kins.home_mm[joint] + kins.offset_mm[joint]:.9f}\n"
            kind = "LINEAR"
            if kins.tables:
                (folder / f"joint-{joint}.comp").write_text(kins.tables[joint], encoding="utf-8")
                homed += f"COMP_FILE = joint-{joint}.comp\nCOMP_FILE_TYPE = 1\n"
        ini.append(f"[AXIS_{axis}]\n{both}[JOINT_{joint}]\nTYPE = {kind}\n{both}{homed}")
    hal = [text_of(shipped / "planner.hal"), *(() if kins is None else kins.hal), ""]
    files = {
        "planner.ini": "".join(ini),
        "planner.tbl": "T1 P1 D0.1 Z0\n",
        "planner.var": "",
        "planner.hal": "\n".join(hal),
        "drive.py": text_of(shipped / "drive.py"),
    }
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


def _quickened(text: str, faster: int) -> str:
    """Return the program with feeds multiplied and dwells divided; comments stay unchanged."""
    if faster == 1:
        return text

    def one(line: str) -> str:
        words, semicolon, comment = line.partition(";")
        if words.lstrip().startswith("("):
            return line
        words = re.sub(r"\bF([\d.]+)", lambda found: f"F{float(found[1]) * faster:.9g}", words)
        if re.search(r"\bG0?4\b", words):
            words = re.sub(r"\bP([\d.]+)", lambda found: f"P{float(found[1]) / faster:.9f}", words)
        return words + semicolon + comment

    return "\n".join(one(line) for line in text.split("\n"))


def _first_point(text: str) -> str:
    for line in text.splitlines():
        words = dict(re.findall(r"([XYZABC])(-?[\d.]+)", line.partition(";")[0]))
        if len(words) == len("XYZABC"):
            return " ".join(f"{axis}{value}" for axis, value in words.items())
    raise RuntimeError("no move names all six axes")


@contextmanager
def alone() -> Iterator[None]:
    """Wait until no other LinuxCNC runs: a computer can run only one at a time."""
    handle = open_to_change(Path(tempfile.gettempdir()) / "dbbstation-planner.lock", create=True)
    try:
        while True:
            try:
                lock(handle)
                break
            except BlockingIOError:
                time.sleep(0.1)
        yield
    finally:
        os.close(handle)


def _printed(folder: Path) -> str:
    command: Sequence[str] = ["linuxcnc", "-r", "planner.ini"]
    if is_root():
        user, group = (os.environ.get(name, NOBODY) for name in ("SUDO_UID", "SUDO_GID"))
        for path in (folder, *folder.iterdir()):
            shutil.chown(path, int(user), int(group))
        command = ["setpriv", f"--reuid={user}", f"--regid={group}", "--clear-groups", *command]
    running = subprocess.Popen(  # noqa: S603 - LinuxCNC itself
        command,
        cwd=folder,
        env={"PATH": os.environ["PATH"], "HOME": str(folder), "LANG": "C.UTF-8"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        printed, _ = running.communicate(timeout=PATIENCE_S)
    except BaseException:
        end_tree(running)
        # What LinuxCNC started as daemons ends by its own means.
        subprocess.run(["halrun", "-U"], stdin=subprocess.DEVNULL, capture_output=True, check=False)  # noqa: S607 - as LinuxCNC has it
        raise
    return printed


def _read(samples: Path, period_s: float) -> PlannerRun:
    table = np.loadtxt(samples, comments="o")
    number, poses, line = table[:, 0], table[:, 1:7], table[:, 7].astype(int)
    moving = np.flatnonzero(np.any(np.diff(poses, axis=0) != 0.0, axis=1))
    if len(moving) == 0:
        raise RuntimeError("the program moved nothing")
    if np.any(np.diff(number[moving[0] : moving[-1] + 2]) != 1):
        raise RuntimeError("servo cycles were lost in the recording")
    kept = slice(moving[0], moving[-1] + 2)
    return PlannerRun((number[kept] - number[kept][0]) * period_s, poses[kept], line[kept])
