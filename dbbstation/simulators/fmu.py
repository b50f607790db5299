"""Run a simulator as FMU (FMI 2 or 3), by the optional FMPy.

Ports are FMU inputs of the port's name; signals are its variables.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.catalogue import FOREIGN
from dbbstation.diagnosis.simulator.ports import SimulationFault
from dbbstation.files.gateway import content_of, opened
from dbbstation.simulators.exchanged import ExchangedSimulator

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from dbbstation.computing.arrays import Floats


MOST_UNPACKED_MB, MOST_DESCRIBED_MB, MOST_FILES = 2000.0, 50.0, 20_000
"""Bounds of an unpacked FMU: its size, the size of its description, and the number of files. A vehicle model has some
100 MB."""

_DESCRIPTION = "modelDescription.xml"


def fault_of_fmu(path: Path) -> str:
    """Return why a file is not a valid FMU; empty if it is valid. Nothing is unpacked."""
    try:
        with opened(path) as _, zipfile.ZipFile(path) as archive:
            sizes = {one.filename: one.file_size / 1e6 for one in archive.infolist()}
    except (OSError, zipfile.BadZipFile, NotImplementedError, ValueError) as error:
        return f"is no FMU: {error}"
    if _DESCRIPTION not in sizes:
        return f"is no FMU: it has no {_DESCRIPTION}"
    # Python unpacks no more than an archive states.
    for size, most in ((sum(sizes.values()), MOST_UNPACKED_MB), (sizes[_DESCRIPTION], MOST_DESCRIBED_MB)):
        if size > most:
            return f"unpacks to {size:,.0f} MB, at most {most:g} MB are unpacked"
    return f"holds {len(sizes):,} files, at most {MOST_FILES:,} are unpacked" if len(sizes) > MOST_FILES else ""


@dataclass(frozen=True, eq=False)
class FmuSimulator(ExchangedSimulator):
    """An FMU with outputs at equal steps, interpolated linearly.

    Attributes:
        variables: FMU's names by the program's names; signals are `port.signal` or `signal`.
    """

    path: Path
    variables: Mapping[str, str]

    @property
    def said(self) -> str:
        """Return its path."""
        return str(self.path)

    def simulate_once(self, columns: Mapping[str, Floats], parameters: Mapping[str, float]) -> Mapping[str, Floats]:
        """Simulate the FMU once.

        Raises:
            SimulationFault: FMPy is missing, the FMU lacks a variable, fails, or takes too long.
        """
        try:
            import fmpy  # noqa: PLC0415 - an extra
        except ImportError:
            raise SimulationFault("FMPy is not installed; `pip install 'dbbstation[fmu]'`") from None
        t = columns["t"]
        driven = {self._of(name): values for name, values in columns.items() if name != "t"}
        table = np.zeros(len(t), dtype=[("time", np.float64), *((name, np.float64) for name in driven)])
        table["time"] = t
        for name, values in driven.items():
            table[name] = values
        wanted = {name: self._of(name) for name in self.outputs} | {
            f"{port}.{signal}": self.variables.get(f"{port}.{signal}", self._of(signal))
            for port, signals in self.ports.items()
            for signal in signals
        }
        try:
            # FMPy leaves a file open whose description it cannot read, so it gets the content.
            description = fmpy.read_model_description(io.BytesIO(content_of(self.path)))
            found = fmpy.simulate_fmu(
                str(self.path),
                model_description=description,
                start_time=float(t[0]),
                stop_time=float(t[-1]),
                output_interval=float(np.min(np.diff(t))),
                start_values={self._of(name): value for name, value in parameters.items()},
                input=table if driven else None,
                output=list(dict.fromkeys(wanted.values())),
                timeout=self.limit_s,
            )
        except FOREIGN as error:
            raise SimulationFault(f"{self.path.name}: {error}") from error
        if float(found["time"][-1]) < float(t[-1]) - 1e-6 * float(t[-1] - t[0]):
            raise SimulationFault(f"{self.path.name} takes longer than {self.limit_s:g} s; raise `time_limit_s`")
        return {name: np.interp(t, found["time"], found[variable]) for name, variable in wanted.items()}

    def _of(self, name: str) -> str:
        return self.variables.get(name, name)
