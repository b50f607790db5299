"""NC programs that command the circles of a plan."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import InputError, StationError, read_each
from dbbstation.files.source_text import decode, read_bytes, without_faults
from dbbstation.nc.commanded import poses_at_progress
from dbbstation.nc.mark import check_nominal
from dbbstation.nc.reach import check_reach
from dbbstation.nc.registry import dialect_of_file, known_dialects

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.toolpath import Toolpath
    from dbbstation.plan.plan import Circle, Direction, Plan

_MODEL = re.compile(r"model file: .*\bsha256 ([0-9a-f]{64})")
"""Pattern of the model's name in the header of a compensated program."""

_PHI_DEG = np.linspace(0.0, 359.0, 360)


@dataclass(frozen=True)
class RunProgram:
    """A program that commands one run."""

    name: str
    content: bytes
    model_sha256: str


def load_programs(folder: Path, plan: Plan, machine: Machine) -> dict[tuple[str, Direction], RunProgram]:
    """Read the programs of all runs of a plan, named TEST-DIRECTION with a dialect's extension.

    Raises:
        InputError: a program is missing, cannot be read, or runs another circle; every fault of every file.
        TravelError: a program leaves the machine's travel.
    """

    def read(run: tuple[str, Direction]) -> RunProgram:
        return _loaded(_file_of(folder, f"{run[0]}-{run[1]}"), circles[run], machine)

    circles = plan.runs()
    return dict(zip(circles, read_each(read, circles), strict=True))


def read_toolpath(path: Path, content: bytes) -> Toolpath:
    """Return the toolpath that a program file commands.

    Raises:
        InputError: faults with line and column.
        ModelError: no dialect has files with that extension.
    """
    text = without_faults(decode, content, str(path))
    return dialect_of_file(path.name, text).read(text, str(path))


def _file_of(folder: Path, stem: str) -> Path:
    extensions = sorted({dialect.extension for dialect in known_dialects().values()})
    candidates = [folder / (stem + extension) for extension in extensions]
    found = [path for path in candidates if path.is_file()]
    if len(found) == 1:
        return found[0]
    what = f"there is no program {stem}" if not found else f"several programs are called {stem}"
    names = ", ".join(path.name for path in found or candidates)
    remedy = f"write it with `dbbstation program` ({names})" if not found else f"leave one of {names}"
    raise InputError.of(folder, what, remedy)


def _loaded(path: Path, circle: Circle, machine: Machine) -> RunProgram:
    content = without_faults(read_bytes, path)
    try:
        toolpath = read_toolpath(path, content)
        poses_at_progress(toolpath, circle, _PHI_DEG)
        if machine.control is not None:
            check_nominal(toolpath)
    except InputError:
        raise
    except StationError as error:
        what = f"{error.what}, and the control corrects already: {machine.control.said if machine.control else ''}"
        raise InputError.of(path, what, "measure with nominal programs") from error
    check_reach(machine, toolpath)
    named = [match[1] for text in toolpath.text.values() if (match := _MODEL.match(text))]
    return RunProgram(path.name, content, named[0] if named else "")
