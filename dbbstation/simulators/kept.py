"""Keep simulations in the user's cache folder, by the content of their inputs."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.model import SimulationOutcome
from dbbstation.files.kept import folder_problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.diagnosis.simulator.model import Model, SimulationRequest

_LOG = logging.getLogger(__name__)

MOST_BYTES = 1_000_000_000
"""Greatest size of the cache [bytes]; simulations whose last use is longest ago are deleted first."""

_PATIENCE_S = 5.0
"""Longest wait for another process that writes [s]."""


class KeptSimulations:
    """The stored simulations of one simulator and its recordings; a context manager.

    Attributes:
        problem: why nothing can be kept; may be empty.
    """

    def __init__(self, content: str, model: Model) -> None:
        self._file = simulations_folder() / f"{_of_all(content, model)[:32]}.sqlite"
        self._base: sqlite3.Connection | None = None
        self.problem = folder_problem(self._file)
        if not self.problem:
            self._open()

    def close(self) -> None:
        """Close the file; all simulations are already written."""
        if self._base is not None:
            self._base.close()
            self._base = None

    def known(
        self, asks: Iterable[SimulationRequest], shape: Mapping[int, tuple[int, int]]
    ) -> dict[SimulationRequest, SimulationOutcome]:
        """Return kept simulations."""
        found: dict[SimulationRequest, SimulationOutcome] = {}
        if self._base is None:
            return found
        try:
            for ask in asks:
                if _kept_at_all(ask):
                    row = self._base.execute("SELECT outputs FROM simulation WHERE key = ?", (_key(ask),)).fetchone()
                    if row is not None:
                        values = np.frombuffer(row[0], dtype="<f8").astype(np.float64)
                        found[ask] = SimulationOutcome(values.reshape(shape[ask.run]))
        except (sqlite3.Error, ValueError) as error:
            self._give_up(str(error))
        return found

    def keep(self, pairs: Sequence[tuple[SimulationRequest, SimulationOutcome]]) -> None:
        """Keep simulations without signals, which are too large."""
        rows = [(_key(ask), found.outputs.astype("<f8").tobytes()) for ask, found in pairs if _kept_at_all(ask)]
        if self._base is None or not rows:
            return
        try:
            with self._base:
                self._base.executemany("INSERT OR REPLACE INTO simulation VALUES (?, ?)", rows)
        except sqlite3.Error as error:
            self._give_up(str(error))

    def _open(self) -> None:
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            _make_room(self._file)
            for attempt in range(2):
                try:
                    base = sqlite3.connect(self._file, timeout=_PATIENCE_S)
                    base.execute("CREATE TABLE IF NOT EXISTS simulation (key BLOB PRIMARY KEY, outputs BLOB)")
                except sqlite3.OperationalError:  # locked, no room, no permission: not for us to remove
                    raise
                except sqlite3.DatabaseError as error:
                    _LOG.info("the file %s is damaged and is begun anew: %s", self._file, error)
                    self._file.unlink()
                    if attempt:
                        raise
                else:
                    self._base = base
                    self._file.touch()
                    return
        except (OSError, sqlite3.Error) as error:
            self._give_up(str(error))

    def _give_up(self, why: str) -> None:
        self.close()
        self.problem = f"no simulations are kept ({self._file}): {why}"
        _LOG.info("%s", self.problem)


def simulations_folder() -> Path:
    """Return the folder of stored simulations."""
    import platformdirs  # noqa: PLC0415 - only who simulates looks for it

    return Path(platformdirs.user_cache_path("dbbstation", appauthor=False)) / "simulations"


def _make_room(used: Path) -> None:
    with contextlib.suppress(OSError):
        room = MOST_BYTES
        for one in sorted(used.parent.glob("*.sqlite"), key=lambda file: (file != used, -file.stat().st_mtime)):
            room -= one.stat().st_size
            if room < 0:
                one.unlink()


def _kept_at_all(ask: SimulationRequest) -> bool:
    return not ask.records and ask.trial is None


def _of_all(content: str, model: Model) -> str:
    digest = hashlib.sha256(content.encode())
    digest.update(repr([(o.name, o.filter_s) for o in model.outputs]).encode())
    digest.update(repr([(port.name, sorted(port.signals)) for port in model.ports]).encode())
    for run in model.runs:
        for name in sorted(run.inputs):
            digest.update(name.encode() + np.ascontiguousarray(run.inputs[name], dtype="<f8").tobytes())
    return digest.hexdigest()


def _key(ask: SimulationRequest) -> bytes:
    acting = [(t.port, t.form.value, t.signals, t.numbers, t.fixed, t.own.name if t.own else "") for t in ask.terms]
    return hashlib.sha256(repr((ask.run, ask.parameters, acting)).encode()).digest()
