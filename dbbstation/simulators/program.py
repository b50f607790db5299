"""Run a simulator as a program, which reads `inputs.csv` and `parameters.json` and writes `outputs.csv`."""

from __future__ import annotations

import csv
import io
import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.ports import SimulationFault
from dbbstation.files.gateway import content_of
from dbbstation.simulators.exchanged import ExchangedSimulator
from dbbstation.system.children import BoundExceededError, ProgramBounds, run_bounded

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats

INPUTS, PARAMETERS, OUTPUTS = "inputs.csv", "parameters.json", "outputs.csv"
"""Files in the program's working folder."""

MOST_MEMORY_MB = 4000.0
"""Memory of a program and its child processes [MB]: the free memory of a laptop of 8 GB beside this program."""

MOST_OUTPUT_MB = 500.0
"""Files and printed text of one run [MB]: a million rows of twenty columns."""

LINES_TOLD = 3
"""Number of last lines on standard error that are reported if the program fails."""


@dataclass(frozen=True, eq=False)
class ProgramSimulator(ExchangedSimulator):
    """A program that runs once per simulation, in an empty folder.

    Attributes:
        command: with whole paths of files beside the model file.
    """

    command: tuple[str, ...]

    @property
    def said(self) -> str:
        """Return its command."""
        return " ".join(self.command)

    def simulate_once(self, columns: Mapping[str, Floats], parameters: Mapping[str, float]) -> Mapping[str, Floats]:
        """Run the program once.

        Raises:
            SimulationFault: it cannot run, fails, takes too long, or writes other outputs.
        """
        with tempfile.TemporaryDirectory(prefix="dbbstation-") as name:
            folder = Path(name)
            with (folder / INPUTS).open("w", encoding="utf-8", newline="") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(columns)
                writer.writerows(zip(*(map(repr, values.tolist()) for values in columns.values()), strict=True))
            (folder / PARAMETERS).write_text(json.dumps(dict(parameters)) + "\n", encoding="utf-8")
            self._run(folder)
            return _read(folder / OUTPUTS)

    def _run(self, folder: Path) -> None:
        said = f"`{self.said}`"
        try:
            done = run_bounded(self.command, folder, ProgramBounds(self.limit_s, MOST_MEMORY_MB, MOST_OUTPUT_MB))
        except BoundExceededError as error:
            remedy = "; raise `time_limit_s`" if error.of_time else ""
            raise SimulationFault(f"{said} {error}{remedy}") from None
        except OSError as error:
            raise SimulationFault(f"{said} cannot be run: {error.strerror}") from error
        if done.code:
            last = done.said.strip().splitlines()[-LINES_TOLD:]
            raise SimulationFault(f"{said} ended with code {done.code}: {' / '.join(last) or 'it said nothing'}")


def _read(path: Path) -> dict[str, Floats]:
    try:
        rows = list(csv.reader(io.StringIO(content_of(path).decode("utf-8"), newline="")))
    except (OSError, UnicodeDecodeError) as error:
        raise SimulationFault(f"it wrote no `{OUTPUTS}` that can be read") from error
    if not rows:
        raise SimulationFault(f"its `{OUTPUTS}` is empty")
    head, body = [cell.strip() for cell in rows[0]], [row for row in rows[1:] if row]
    for number, row in enumerate(body, 2):
        if len(row) != len(head):
            raise SimulationFault(f"row {number} of its `{OUTPUTS}` has {len(row)} cells, {len(head)} are expected")
    try:
        values = np.array(body, dtype=np.float64).reshape(len(body), len(head))
    except ValueError as error:
        raise SimulationFault(f"its `{OUTPUTS}` has a cell that is not a number: {error}") from error
    return {name: values[:, k].copy() for k, name in enumerate(head)}


def whole_command(words: tuple[str, ...], folder: Path) -> tuple[str, ...]:
    """Return a command with full paths for files beside the model file."""
    return tuple(str((folder / word).absolute()) if (folder / word).is_file() else word for word in words)
