"""LinuxCNC's trajectory planner as a function: a program in, the commanded pose of every servo cycle out.

Needs the package `linuxcnc-uspace` (Debian, Ubuntu). LinuxCNC does not run as root: where the tests do, an ordinary user
is made for it.

LinuxCNC runs in real time. With `faster` its clock runs that many times as fast: the servo period and all times are divided
by it, speeds multiplied by it, accelerations by its square, so that every servo cycle calculates with the same way per
cycle and the same change of it. Samples are given with the times that they would have at the usual clock. The interpreter
is not part of that clock. Where it falls behind the planner, the program is run again with a slower one.
"""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import signal
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
USER = "dbbstation-planner"
NEEDED = ("linuxcnc", "halsampler", "rtapi_app", "setpriv")

PERIOD_NS = 1_000_000
"""Servo period at the usual clock."""

GREATEST_MM_S, GREATEST_DEG_S, GREATEST_DEG_S2 = 500.0, 600.0, 10_000.0
"""Speeds of axes, and the acceleration of the angles: no limit for any program here."""

RAMP_HZ = 100.0
"""What `ARC_BLEND_RAMP_FREQ` is where a file does not say: moves that end within its period change speed evenly. It has a clock of its own."""


BEHIND = "the interpreter fell behind the planner"
"""As `drive.py` has it."""


class BehindError(RuntimeError):
    """The planner's queue ran empty on the way: what it did then is not what the program asks for."""


def missing() -> str:
    lacking = [name for name in NEEDED if shutil.which(name) is None]
    if lacking:
        return f"LinuxCNC is not installed: no {', '.join(lacking)}"
    if os.getuid() == 0 and not _has_user() and shutil.which("useradd") is None:
        return "LinuxCNC does not run as root, and there is no useradd to make a user for it"
    return ""


@dataclass(frozen=True, eq=False)
class Ran:
    """What the planner made of a program.

    Attributes:
        time_s: of each sample, from the first servo cycle that moves to the last, shape (n,) [s].
        poses: commanded, shape (n, 6) [mm, deg]; with a kinematics driven lengths of the joints [mm].
        line: of the program, shape (n,).
    """

    time_s: np.ndarray
    poses: np.ndarray
    line: np.ndarray

    @property
    def duration_s(self) -> float:
        """From the first motion to the last, dwells and stops included [s]."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def moving_s(self) -> float:
        """Time in motion [s]: without dwells and stops, whose length hangs on how busy the computer is."""
        return float(np.diff(self.time_s)[np.any(np.diff(self.poses, axis=0) != 0.0, axis=1)].sum())


@dataclass(frozen=True, eq=False)
class Kins:
    """A kinematics in place of none: what is recorded are joints then.

    Attributes:
        name: of the module.
        home_mm: joints at which the machine is switched on, shape (6,).
        offset_mm: added to HOME and HOME_OFFSET, shape (6,).
        home_z_mm: height at which it is switched on, upright over the middle: where LinuxCNC begins to look for its pose.
        hal: lines behind the module's loading.
        tables: text of each joint's `COMP_FILE`; empty for none.
    """

    name: str
    home_mm: np.ndarray
    offset_mm: np.ndarray
    home_z_mm: float
    hal: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()


def run(
    text: str, *, mm_s2: float = 1000.0, faster: int = 1, patience_s: float = 600.0, kins: Kins | None = None
) -> Ran:
    """Run a program on the planner, from its first point on.

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
            return run_once(text, mm_s2, faster, patience_s, kins)
        except BehindError:
            if faster == 1:
                raise
            faster = max(faster // 2, 1)


def run_once(text: str, mm_s2: float, faster: int, patience_s: float = 600.0, kins: Kins | None = None) -> Ran:
    """Run a program with this clock, or raise; arguments as for `run`."""
    with tempfile.TemporaryDirectory(prefix="dbbstation-planner-") as made, _Alone():
        folder = Path(made)
        _configure(folder, mm_s2, faster, kins)
        (folder / "program.ngc").write_text(_quickened(text, faster))
        (folder / "start.txt").write_text(_first_point(text))
        printed = _started(folder, patience_s)
        ended = folder / "ended.txt"
        if ended.exists() and ended.read_text() == BEHIND:
            raise BehindError(BEHIND)
        if not ended.exists() or ended.read_text() != "ended":
            raise RuntimeError(ended.read_text() if ended.exists() else f"LinuxCNC did not start:\n{printed}")
        ran = _read(folder / "samples.txt", PERIOD_NS / 1e9)
        # `motor-pos-cmd` is the joint less its HOME_OFFSET.
        return ran if kins is None else Ran(ran.time_s, ran.poses + kins.home_mm, ran.line)


def _configure(folder: Path, mm_s2: float, faster: int, kins: Kins | None = None) -> None:
    limits = {
        "period_ns": PERIOD_NS // faster,
        "mm_s": GREATEST_MM_S * faster,
        "deg_s": GREATEST_DEG_S * faster,
        "mm_s2": mm_s2 * faster**2,
        "deg_s2": GREATEST_DEG_S2 * faster**2,
        "ramp_hz": RAMP_HZ * faster,
    }
    ini = [(HERE / "planner.ini").read_text().format(**limits)]
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
                (folder / f"joint-{joint}.comp").write_text(kins.tables[joint])
                homed += f"COMP_FILE = joint-{joint}.comp\nCOMP_FILE_TYPE = 1\n"
        ini.append(f"[AXIS_{axis}]\n{both}[JOINT_{joint}]\nTYPE = {kind}\n{both}{homed}")
    (folder / "planner.ini").write_text("".join(ini))
    (folder / "planner.tbl").write_text("T1 P1 D0.1 Z0\n")
    (folder / "planner.var").write_text("")
    for name in ("planner.hal", "drive.py"):
        shutil.copy(HERE / name, folder / name)
    if kins is not None and kins.hal:
        hal = (folder / "planner.hal").read_text()
        (folder / "planner.hal").write_text("\n".join([hal, *kins.hal, ""]))
    (folder / "drive.py").chmod(0o755)


def _quickened(text: str, faster: int) -> str:
    """The program with feeds multiplied and dwells divided; comments are left alone."""
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
        if len(words) == 6:
            return " ".join(f"{axis}{value}" for axis, value in words.items())
    raise RuntimeError("no move names all six axes")


class _Alone:
    """There is one LinuxCNC on a computer at a time."""

    def __enter__(self) -> None:
        self._lock = (Path(tempfile.gettempdir()) / "dbbstation-planner.lock").open("w")
        fcntl.flock(self._lock, fcntl.LOCK_EX)

    def __exit__(self, *_: object) -> None:
        self._lock.close()


def _has_user() -> bool:
    return (
        subprocess.run(
            ["id", USER],  # noqa: S607 - as the system has it
            capture_output=True,
            check=False,
        ).returncode
        == 0
    )


def _started(folder: Path, patience_s: float) -> str:
    command = ["linuxcnc", "-r", "planner.ini"]
    if os.getuid() == 0:
        if not _has_user():
            made = ["useradd", "--system", "--no-create-home", "--shell", "/bin/sh", USER]
            subprocess.run(made, check=True)
        for path in (folder, *folder.iterdir()):
            shutil.chown(path, USER, USER)
        command = ["setpriv", f"--reuid={USER}", f"--regid={USER}", "--init-groups", *command]
    running = subprocess.Popen(
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
        printed, _ = running.communicate(timeout=patience_s)
    except BaseException:
        # LinuxCNC's script takes everything down that it started when it is told to end.
        os.killpg(running.pid, signal.SIGTERM)
        running.communicate()
        raise
    return printed


def _read(samples: Path, period_s: float) -> Ran:
    table = np.loadtxt(samples, comments="o")
    number, poses, line = table[:, 0], table[:, 1:7], table[:, 7].astype(int)
    moving = np.flatnonzero(np.any(np.diff(poses, axis=0) != 0.0, axis=1))
    if len(moving) == 0:
        raise RuntimeError("the program moved nothing")
    if np.any(np.diff(number[moving[0] : moving[-1] + 2]) != 1):
        raise RuntimeError("servo cycles were lost in the recording")
    kept = slice(moving[0], moving[-1] + 2)
    return Ran((number[kept] - number[kept][0]) * period_s, poses[kept], line[kept])
