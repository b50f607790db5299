"""Three public recordings beside simulations that lack what is known of them: what the levels answer.

    python -m tests.diagnosis.table.public_tables FOLDER --out docs/validation/tables-public.json

FOLDER has `exchanger.csv`, `tanque.csv` and `ball-and-beam.csv` of github.com/Rafa7046/Non_Linear_Identification, which are DaISy 97-002
[Bittanti and Piroddi], the cascaded tanks of nonlinearbenchmark.org [Schoukens et al. 2016] and DaISy 96-004 [De Moor et al.].
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.inference.variables import Kind, Variable
from dbbstation.results.of_mismatch import mismatch_result

if TYPE_CHECKING:
    from numpy.typing import NDArray


def columns_of(file: Path, rows: int) -> dict[str, NDArray[np.float64]]:
    """Numbers of the first rows, by name."""
    with file.open(encoding="utf-8", newline="") as text:
        lines = [line for line, _ in zip(csv.DictReader(text), range(rows), strict=False)]
    names = [name for name, value in lines[-1].items() if name and value]
    return {name: np.array([float(line[name]) for line in lines]) for name in names}


def table(
    measured: NDArray[np.float64], simulated: NDArray[np.float64], unit: str, step_s: float, signals: dict[str, tuple]
) -> Table:
    """Table of one run."""
    clock = Variable("t_s", "s", Kind.TIME, step_s * np.arange(len(measured)))
    variables = tuple(Variable(name, of, kind, values) for name, (of, kind, values) in signals.items())
    rows = (slice(0, len(measured)),)
    return Table(
        measured, simulated, unit, "simulated", (clock, *variables), {}, {}, rows, ("run",), clock, has_offset=True
    )


def lagging(values: NDArray[np.float64], rows: float) -> NDArray[np.float64]:
    """First-order lag of so many rows, settled on the first value."""
    decay = float(np.exp(-1.0 / rows))
    return lfilter([1.0 - decay], [1.0, -decay], values, zi=[decay * values[0]])[0]


def exchanger(folder: Path) -> Table:
    """Outlet temperature of a heat exchanger; simulated is its mean. Known: it follows the flow late."""
    raw = columns_of(folder / "exchanger.csv", 1200)
    flat = np.full(1200, float(np.mean(raw["th"])))
    return table(raw["th"], flat, "degC", 1.0, {"flow": ("", Kind.ANY, raw["q"])})


def tanks(folder: Path) -> Table:
    """Level of the lower of two tanks; simulated with linear outlets. Known: outlets go with the root of the level, and it overflows."""
    raw = columns_of(folder / "tanque.csv", 1024)
    late = lagging(lagging(raw["uEst"], 12.0), 12.0)
    gain, offset = np.polyfit(late, raw["yEst"], 1)
    return table(raw["yEst"], gain * late + offset, "V", 4.0, {"pump_v": ("V", Kind.ANY, raw["uEst"])})


def ball(folder: Path) -> Table:
    """Place of a ball on a beam; simulated at rest. Known: its acceleration follows the angle."""
    raw = columns_of(folder / "ball-and-beam.csv", 1000)
    return table(raw["y"], np.zeros(1000), "m", 0.1, {"angle_rad": ("rad", Kind.ANY, raw["u"])})


TABLES = {
    "heat exchanger, simulated as its mean (DaISy)": exchanger,
    "cascaded tanks, simulated linear (nonlinearbenchmark.org)": tanks,
    "ball on a beam, simulated at rest (DaISy)": ball,
}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("folder", type=Path)
    options.add_argument("--out", type=Path, required=True)
    chosen = options.parse_args()
    figures = {}
    for name, made in TABLES.items():
        began = time.process_time()
        result = mismatch_result(find_mismatch(made(chosen.folder)))
        held, unit = result.held_out_rms, result.unit
        told = [one for one in result.levels.follows if one.answer == "follows"]
        laws = [f"{one.name}: {' + '.join(one.form.names) or 'law open'}" for one in told if one.form is not None]
        error = f"{held.as_simulated:.3g} → {held.after:.3g} {unit}" if held else ""
        figures[name] = [str(result.levels.differs.answer), "; ".join(laws) or "no class follows", error]
        print(name, f"{time.process_time() - began:.0f} s", *result.sentences(), sep="\n  ")  # noqa: T201
    git = ["git", "rev-parse", "--short=8", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False)
    stored = {
        "question": "What do three levels answer of public recordings beside simple simulations?",
        "data": "Three tables of github.com/Rafa7046/Non_Linear_Identification, e5c9b006: the first 1,200, 1,024 and 1,000 rows.",
        "command": "python -m tests.diagnosis.table.public_tables FOLDER --out docs/validation/tables-public.json",
        "commit": commit.stdout.strip(),
        "date": datetime.now(UTC).date().isoformat(),
        "seed": "",
        "limits": "One recording each.",
        "columns": ["differs", "follows, and law", "held-out error"],
        "figures": figures,
    }
    chosen.out.write_text(json.dumps(stored, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
