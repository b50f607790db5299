"""`dbb-simulator/1`: a user's simulator with its parameters, outputs and ports."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from dbbstation.errors import Faults, Problem
from dbbstation.facts.quantities import Text, sound
from dbbstation.files.source_text import LARGEST_PROGRAM, text_in, without_faults
from dbbstation.files.yaml.schema import Rules, Schema, read_valid

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.files.yaml.text import Location, YamlDocument


def _no_name(text: str) -> str:
    return "" if text.isidentifier() and not text.startswith("_") else f"`{text}` is not a valid name in Python"


Name = Annotated[str, sound(_no_name)]
"""A name that Python allows."""

BASE = "Simulator"
"""Class that a simulator derives from."""

CONTRACT = "see `A simulator in the loop` in docs/mismatch-simulator.md"


class ParameterSchema(Schema):
    """One parameter of the simulator that is refitted."""

    value: float
    """Its present value, in its unit."""
    unit: str = ""
    """Its unit, as printed."""
    uncertainty: Annotated[float, Field(gt=0.0)] | None = None
    """Prior standard uncertainty, in its unit; absent: only the bounds are known."""
    low: float | None = None
    """Least possible value."""
    high: float | None = None
    """Greatest possible value."""

    def _rules(self) -> Rules:
        low = -float("inf") if self.low is None else self.low
        high = float("inf") if self.high is None else self.high
        yield not low < high, f"`low` {low} is not below `high` {high}"
        yield not low <= self.value <= high, f"the value {self.value} is outside the bounds {low} to {high}"


class OutputSchema(Schema):
    """One quantity that is measured and simulated."""

    column: Text
    """Column of the measured values in the recordings."""
    unit: str = ""
    """Unit of both."""
    filter_s: Annotated[float, Field(gt=0.0)] | None = None
    """Time constant of the sensor's first-order filter, applied to simulated values [s]; absent: no filter."""


class SignalSchema(Schema):
    """One quantity that is known at a port."""

    unit: str = ""
    """Its unit; angles in rad, deg or turn."""
    result: bool = False
    """Whether it results from the simulation, so that it cannot cause a difference."""


class PortSchema(Schema):
    """One point of the simulator at which a missing term may act."""

    about: str = ""
    """Description of the port."""
    unit: str = ""
    """Unit of the term."""
    signals: dict[Name, str | SignalSchema] = Field(default_factory=dict)
    """Known quantities at the port, with their units; angles in rad, deg or turn. Write a quantity that results from
    the simulation as `{unit: N m, result: true}`."""

    @property
    def units(self) -> dict[str, str]:
        """Return units of the signals."""
        return {name: one if isinstance(one, str) else one.unit for name, one in self.signals.items()}

    @property
    def results(self) -> frozenset[str]:
        """Return signals that result from the simulation."""
        return frozenset(name for name, one in self.signals.items() if not isinstance(one, str) and one.result)


class SimulatorFile(Schema):
    """File of a simulator in the loop."""

    format: Literal["dbb-simulator/1"]
    """Name and version of this format."""
    name: Text
    """Name of the simulator."""
    python: Text | None = None
    """Python file with a class that derives from `Simulator`, beside this file. It is executed."""
    program: Annotated[tuple[Text, ...], Field(min_length=1)] | None = None
    """Program and its arguments, in place of `python`: it reads `inputs.csv` and `parameters.json` and writes
    `outputs.csv` in its working folder. It is executed."""
    fmu: Text | None = None
    """FMU (FMI 2 or 3) beside this file, in place of `python`. It is executed by FMPy, an extra of the installation."""
    variables: dict[str, str] = Field(default_factory=dict)
    """Variables of the FMU by the names here, if they differ; a signal is named `port.signal`, or `signal`."""
    time: Text
    """Column of the recordings with the rising time [s]."""
    inputs: dict[Name, str] = Field(default_factory=dict)
    """Columns of the recordings for the simulator, by the simulator's name for each; `t` is the time."""
    parameters: dict[Name, ParameterSchema] = Field(default_factory=dict)
    """Parameters that are refitted with every tried term."""
    states: dict[Name, ParameterSchema] = Field(default_factory=dict)
    """Initial states, which are refitted for each recording separately."""
    outputs: Annotated[dict[Name, OutputSchema], Field(min_length=1)]
    """Compared outputs; several are weighted by their noise."""
    ports: Annotated[dict[Name, PortSchema], Field(min_length=1)]
    """Points at which a missing term may act."""
    time_limit_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 60.0
    """Longest time of one simulation [s]; a longer one is refused with its input."""

    def _rules(self) -> Rules:
        programs = sum(one is not None for one in (self.python, self.program, self.fmu))
        yield programs != 1, "one of `python`, `program` and `fmu` is expected"
        for name in sorted(set(self.parameters) & set(self.states)):
            yield True, f"`{name}` is both a parameter and a state"
        yield "t" in self.inputs, "the input `t` already means the time; give it another name"
        for name, port in self.ports.items():
            yield "t" in port.signals, f"the signal `t` of port `{name}` already means the time"


def parse_simulator(path: Path, faults: list[Problem]) -> SimulatorFile | None:
    """Read a simulator's file and inspect its Python without running it; None with faults added to `faults`."""
    read = read_valid(path, SimulatorFile, faults)
    if read is None:
        return None
    document, found = read
    before = len(faults)
    if found.python is not None:
        _look_through(path, document, found, found.python, faults)
    elif found.fmu is not None and not (path.parent / found.fmu).is_file():
        document.fault(("fmu",), f"`{found.fmu}` is not there", "name an FMU beside this file")
    return found if len(faults) == before else None


def read_simulator(path: Path) -> SimulatorFile:
    """Read a simulator's file.

    Raises:
        InputError: every fault of both files with its place.
    """
    return without_faults(parse_simulator, path)


def _look_through(path: Path, document: YamlDocument, found: SimulatorFile, python: str, faults: list[Problem]) -> None:
    source = path.parent / python
    own = Faults(source)
    text = text_in(source, own, LARGEST_PROGRAM)
    if text is None:
        what = f"`{python}` cannot be read: {own[0].what if own else 'it is no text'}"
        document.fault(("python",), what, "name a Python file beside this one")
        return
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", 0) or 0
        faults.append(Problem.of(source, f"is not Python: {error}", "mend the line", line))
        return
    arguments = _arguments(tree, own)
    faults += own
    if own:
        return
    ports, called = arguments[-1], _called(tree, arguments[-1])
    for name, line in called.items():
        if name not in found.ports:
            what = f"`{ports}.{name}` is no port of {path.name}"
            faults.append(Problem.of(source, what, f"there are {', '.join(found.ports)}", line))
    for name in found.ports:
        if name not in called and not _computed(tree, ports):
            at: Location = ("ports", name)
            what = f"port `{name}` is never called in {python}"
            remedy = f"call `{ports}.{name}(t, signals)` where it acts"
            document.fault(at, what, remedy, at_key=True)


def _arguments(tree: ast.AST, faults: Faults) -> list[str]:
    classes = [
        n for n in ast.walk(tree) if isinstance(n, ast.ClassDef) and any(_last(base) == BASE for base in n.bases)
    ]
    if len(classes) != 1:
        many = f"{len(classes)} classes derive" if classes else "no class derives"
        line = classes[1].lineno if classes else 0
        faults.add(f"{many} from {BASE}, one is expected", CONTRACT, line)
        return []
    method = next((n for n in ast.walk(classes[0]) if isinstance(n, ast.FunctionDef) and n.name == "simulate"), None)
    arguments = [argument.arg for argument in method.args.args] if method else []
    if len(arguments) == ARGUMENTS:
        return arguments
    what = f"`simulate` takes {', '.join(arguments)}; self, inputs, parameters and ports are expected"
    if method is None:
        what = "`simulate(self, inputs, parameters, ports)` is not there"
    faults.add(what, CONTRACT, (method or classes[0]).lineno)
    return []


def _called(tree: ast.AST, ports: str) -> dict[str, int]:
    found: dict[str, int] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == ports:
            found.setdefault(node.attr, node.lineno)
    return found


def _computed(tree: ast.AST, ports: str) -> bool:
    plain = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name)}
    return any(isinstance(n, ast.Name) and n.id == ports and id(n) not in plain for n in ast.walk(tree))


def _last(node: ast.expr) -> str:
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


ARGUMENTS = 4
"""Number of arguments of `simulate`, with `self`."""
