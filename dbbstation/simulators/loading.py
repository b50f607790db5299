"""Load a simulator and its recordings for comparison."""

from __future__ import annotations

import shutil
import sys
from dataclasses import dataclass, replace
from functools import lru_cache
from inspect import isabstract
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.contract import Simulator
from dbbstation.diagnosis.simulator.model import Model, Output, SimulatorParameter, SimulatorPort, SimulatorRecording
from dbbstation.errors import MOST_FAULTS, InputError, Problem, refuse
from dbbstation.files.formats.simulator import CONTRACT, SimulatorFile, read_simulator
from dbbstation.files.gateway import content_of
from dbbstation.files.keys import digests_of, key_of
from dbbstation.files.own_classes import classes_in_files, module_name, own_instances
from dbbstation.files.places import real_path
from dbbstation.files.recordings.table_csv import TableFile, read_table
from dbbstation.laws.contract import PortSource, TableSource
from dbbstation.simulators.allowed import files_of_simulator
from dbbstation.simulators.fmu import FmuSimulator, fault_of_fmu
from dbbstation.simulators.program import ProgramSimulator, whole_command

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.files.formats.number_language import NumberLanguage
    from dbbstation.files.formats.simulator import ParameterSchema
    from dbbstation.simulators.exchanged import ExchangedSimulator

FEWEST_ROWS = 30
"""Least number of rows of all recordings together, as for tables."""


@dataclass(frozen=True, eq=False)
class LoadedSimulator:
    """A simulator with its recordings.

    Attributes:
        source: Python file, or runner of a program or FMU.
    """

    path: Path
    source: Path | ExchangedSimulator
    file: SimulatorFile
    model: Model
    own: tuple[PortSource, ...]
    own_files: tuple[Path, ...]

    @property
    def content(self) -> str:
        """Return the simulator's key: all its files, own physics, command and FMU."""
        given = {"task": "simulate", "program": self.file.program, "variables": self.file.variables}
        return key_of(given, digests_of((*self._files, *self.own_files), self.path.parent))

    @property
    def _files(self) -> list[Path]:
        found = files_of_simulator(self.path, self.file)
        if self.file.program is not None:
            program = shutil.which(whole_command(self.file.program, self.path.parent)[0])
            return [*found, *([Path(program)] if program else [])]
        if self.file.python is None:
            return found
        folder = real_path(self.path.parent / self.file.python).parent
        imported = {Path(file) for module in list(sys.modules.values()) if (file := getattr(module, "__file__", None))}
        return [*found, *sorted(one for one in imported if one.is_relative_to(folder) and one.suffix == ".py")]


def load_simulator(
    path: Path, recordings: Sequence[Path], own_files: Sequence[Path] = (), numbers: NumberLanguage | None = None
) -> LoadedSimulator:
    """Read a simulator, recordings and own physics. Python files are executed.

    Raises:
        InputError: every fault with its line.
    """
    file = read_simulator(path)
    faults: list[Problem] = []
    tables = _tables(file, recordings, numbers, faults)
    refuse(faults[:MOST_FAULTS])
    source = _source(path, file)
    parameters = [_parameter(name, name, one) for name, one in file.parameters.items()]
    several = len(tables) > 1
    for run in range(len(tables)):
        for name, one in file.states.items():
            parameters.append(_parameter(f"{name} of run {run + 1}" if several else name, name, one, run))
    model = Model(
        file.name,
        tuple(parameters),
        tuple(SimulatorPort(name, one.unit, one.units, one.about, one.results) for name, one in file.ports.items()),
        tuple(Output(name, one.unit, one.filter_s or 0.0) for name, one in file.outputs.items()),
        tuple(_recorded(file, table) for table in tables),
    )
    return LoadedSimulator(path, source, file, model, tuple(_own(own_files, file)), tuple(own_files))


def _source(path: Path, file: SimulatorFile) -> Path | ExchangedSimulator:
    ports = {name: tuple(port.signals) for name, port in file.ports.items()}
    if file.program is not None:
        command = whole_command(file.program, path.parent)
        return ProgramSimulator(ports, tuple(file.outputs), file.time_limit_s, command)
    if file.fmu is not None:
        fmu = (path.parent / file.fmu).absolute()
        if fault := fault_of_fmu(fmu):
            raise InputError.of(path.parent / file.fmu, fault, "name another FMU")
        return FmuSimulator(ports, tuple(file.outputs), file.time_limit_s, fmu, file.variables)
    python = path.parent / str(file.python)
    simulator_of(python)
    return python


def simulator_of(python: Path) -> Simulator:
    """Return the simulator of an executed Python file.

    Raises:
        InputError: the file cannot be run, or defines no simulator that can be made.
    """
    return _simulator_of(python, content_of(python))


@lru_cache(maxsize=4)
def _simulator_of(python: Path, _content: bytes) -> Simulator:
    faults: list[Problem] = []
    found = classes_in_files([python], Simulator, CONTRACT, faults)
    if len(found) > 1 and not faults:
        faults.append(replace(found[1].place, what="there are two simulators in one file"))
    elif not faults and isabstract(found[0].kind):
        faults.append(found[0].fault(f"{found[0].kind.__name__} lacks simulate"))
    refuse(faults)
    return found[0].made((), lambda _one: ())


def _own(files: Sequence[Path], file: SimulatorFile) -> list[PortSource]:
    def fault_of(one: PortSource) -> tuple[str, str] | None:
        if not one.port and len(file.ports) == 1:
            one.port = next(iter(file.ports))
        if one.port not in file.ports:
            there = ", ".join(file.ports)
            return f"`{one.port}` of {type(one).__name__} is no port; there are {there}", "name one of them"
        signals = file.ports[one.port].signals
        needed = one.needs if isinstance(one, TableSource) else ()
        if missing := [name for name in needed if name not in {"t_s", *signals}]:
            return f"the port `{one.port}` has no signal {', '.join(missing)}", f"it has {', '.join(signals) or 'none'}"
        _try_once(one, signals)
        return None

    return own_instances(files, PortSource, CONTRACT, ("name",), fault_of)  # type: ignore[type-abstract]


def know(files: Sequence[Path]) -> None:
    """Run the user's own physics once in this process, so that its terms can be unpickled."""
    for path in files:
        if module_name(path) not in sys.modules:
            classes_in_files([path], PortSource, CONTRACT, [])  # faults were told where it was loaded


def _try_once(one: PortSource, signals: Iterable[str]) -> None:
    values = {p.name: p.grid[len(p.grid) // 2] if p.grid else p.plausible for p in one.parameters()}
    float(one.value(0.0, dict.fromkeys(signals, 1.0), values))


def _parameter(name: str, key: str, one: ParameterSchema, run: int | None = None) -> SimulatorParameter:
    low = -np.inf if one.low is None else one.low
    high = np.inf if one.high is None else one.high
    return SimulatorParameter(name, key, one.value, one.unit, one.uncertainty, low, high, run)


def _tables(
    file: SimulatorFile, recordings: Sequence[Path], numbers: NumberLanguage | None, faults: list[Problem]
) -> tuple[TableFile, ...]:
    needed = list(dict.fromkeys([file.time, *file.inputs.values(), *(one.column for one in file.outputs.values())]))
    found = []
    for path in recordings:
        try:
            table = read_table(path, needed, numbers)
        except InputError as error:
            faults += error.problems
            continue
        found.append(table)
        for name in needed:
            empty = islice(table.not_finite(name, "leave out the row, or fill it"), 1)
            faults += table.faults_of(name) or empty
        back = np.flatnonzero(np.diff(table.values[file.time]) <= 0.0)
        if len(back):
            remedy = "order the rows by time, and put each run into its own file"
            faults.append(Problem.of(path, f"{file.time} does not rise", remedy, int(table.lines[back[0] + 1])))
    if not faults and sum(map(len, found)) < FEWEST_ROWS:
        what = f"{sum(map(len, found))} rows are too few to compare, {FEWEST_ROWS} are needed"
        faults.append(Problem.of(found[0].file, what, "record more", found[0].header))
    return tuple(found)


def _recorded(file: SimulatorFile, table: TableFile) -> SimulatorRecording:
    inputs: dict[str, Floats] = {"t": table.values[file.time]}
    inputs |= {name: table.values[column] for name, column in file.inputs.items()}
    return SimulatorRecording(
        table.file, inputs, {name: table.values[one.column] for name, one in file.outputs.items()}
    )
