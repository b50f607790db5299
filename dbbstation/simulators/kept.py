"""Keep simulations in the user's cache folder, by the content of their inputs."""

from __future__ import annotations

import contextlib
import hashlib
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.model import SimulationOutcome
from dbbstation.files.kept import CacheFile, folder_problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.diagnosis.simulator.model import Model, SimulationRequest

MOST_BYTES = 1_000_000_000
"""Greatest size of the cache [bytes]; simulations whose last use is longest ago are deleted first."""


class KeptSimulations(CacheFile):
    """The stored simulations of one simulator and its recordings."""

    nothing = "no simulations are kept"

    def __init__(self, content: str, model: Model) -> None:
        file = simulations_folder() / f"{_of_all(content, model)[:32]}.sqlite"
        _make_room(file)
        super().__init__(file, folder_problem(file))

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
        self._write("INSERT OR REPLACE INTO simulation VALUES (?, ?)", rows)

    def _begin(self, base: sqlite3.Connection) -> None:
        base.execute("CREATE TABLE IF NOT EXISTS simulation (key BLOB PRIMARY KEY, outputs BLOB)")
        self._file.touch()


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
