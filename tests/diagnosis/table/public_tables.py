"""Eight public recordings beside simulations that lack what is known of them: what the levels answer.

    python -m tests.diagnosis.table.public_tables FOLDER --out docs/validation/tables-public.json

FOLDER has `exchanger.csv`, `tanque.csv` and `ball-and-beam.csv` of github.com/Rafa7046/Non_Linear_Identification, which are DaISy 97-002
[Bittanti and Piroddi], the cascaded tanks of nonlinearbenchmark.org [Schoukens et al. 2016] and DaISy 96-004 [De Moor et al.]. `CoolingWater.csv` is from
github.com/vincentarelbundock/Rdatasets (csv/mosaicData, data of S. Wagon), as `cars.csv`, `trees.csv` (csv/datasets) and `hills.csv` (csv/MASS). `pontius.csv` has the columns `load,deflection` of NIST StRD Pontius,
whose certified values have a square of -3.16e-15 beside the line, and 2.05e-4 of scatter. Tables in the file are not run again.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import subprocess
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import curve_fit
from scipy.signal import lfilter

from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.levels import CORRECTS
from dbbstation.results.mismatch import mismatch_result

if TYPE_CHECKING:
    from numpy.typing import NDArray


def columns_of(file: Path, rows: int) -> dict[str, NDArray[np.float64]]:
    """Numbers of the first rows, by name."""
    with file.open(encoding="utf-8", newline="") as text:
        lines = [line for line, _ in zip(csv.DictReader(text), range(rows), strict=False)]
    names = [name for name, value in lines[-1].items() if name not in ("", "rownames") and value]
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


def cooling(folder: Path) -> Table:
    """Water in a mug; simulated cools by Newton's law, fitted. Known: the mug warms first, so that the first minutes are faster."""
    raw = columns_of(folder / "CoolingWater.csv", 300)

    def law(t: NDArray[np.float64], room: float, hotter: float, rate: float) -> NDArray[np.float64]:
        return room + hotter * np.exp(-rate * t)

    simulated = law(raw["time"], *curve_fit(law, raw["time"], raw["temp"], (25.0, 70.0, 0.02))[0])
    return table(raw["temp"], simulated, "degC", 60.0, {})


def load_cell(folder: Path) -> Table:
    """Deflection of a load cell, loaded twice; simulated is the fitted line. Known: a square of the load [NIST StRD Pontius]."""
    raw = columns_of(folder / "pontius.csv", 40)
    line = np.polyval(np.polyfit(raw["load"], raw["deflection"], 1), raw["load"])
    made = table(raw["deflection"], line, "mm", 1.0, {"load_n": ("N", Kind.FORCE, raw["load"])})
    return replace(made, blocks=(slice(0, 20), slice(20, 40)), names=("first", "second"))


def sheet(
    measured: NDArray[np.float64],
    simulated: NDArray[np.float64],
    unit: str,
    signals: dict[str, tuple[str, Kind]],
    *given,
) -> Table:
    """Table of rows without an order."""
    variables = tuple(Variable(name, *of, values) for (name, of), values in zip(signals.items(), given, strict=True))
    rows = (slice(0, len(measured)),)
    return Table(measured, simulated, unit, "simulated", variables, {}, {}, rows, ("sheet",), None, has_offset=True)


def in_proportion(measured: NDArray[np.float64], to: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least-squares multiple."""
    return to * float(to @ measured) / float(to @ to)


def braking(folder: Path) -> Table:
    """Stopping distance; simulated in proportion to the speed. Known: the way of braking goes with its square [Ezekiel 1930]."""
    raw = columns_of(folder / "cars.csv", 50)
    speed, way = 0.44704 * raw["speed"], 0.3048 * raw["dist"]
    return sheet(way, in_proportion(way, speed), "m", {"speed_m_s": ("m/s", Kind.SPEED)}, speed)


def hills(folder: Path) -> Table:
    """Times of hill races; simulated in proportion to the way. Known: the climb counts [Naismith]; one time is an hour too long."""
    raw = columns_of(folder / "hills.csv", 35)
    way, climb, took = 1609.344 * raw["dist"], 0.3048 * raw["climb"], 60.0 * raw["time"]
    named = {"way_m": ("m", Kind.LENGTH), "climb_m": ("m", Kind.LENGTH)}
    return sheet(took, in_proportion(took, way), "s", named, way, climb)


def cones(folder: Path) -> Table:
    """Volume of cherry trees; simulated in proportion to that of cones. Known: nothing is missing [Atkinson 1982]."""
    raw = columns_of(folder / "trees.csv", 31)
    wide, high, volume = 0.0254 * raw["Girth"], 0.3048 * raw["Height"], 0.0283168 * raw["Volume"]
    named = {"diameter_m": ("m", Kind.LENGTH), "height_m": ("m", Kind.LENGTH)}
    return sheet(volume, in_proportion(volume, wide**2 * high), "m³", named, wide, high)


FILES = {
    exchanger: "exchanger.csv",
    tanks: "tanque.csv",
    ball: "ball-and-beam.csv",
    cooling: "CoolingWater.csv",
    load_cell: "pontius.csv",
    braking: "cars.csv",
    hills: "hills.csv",
    cones: "trees.csv",
}

TABLES = {
    "cooling water, simulated by Newton's law (mosaicData)": cooling,
    "load cell, simulated as a line (NIST StRD Pontius)": load_cell,
    "heat exchanger, simulated as its mean (DaISy)": exchanger,
    "cascaded tanks, simulated linear (nonlinearbenchmark.org)": tanks,
    "ball on a beam, simulated at rest (DaISy)": ball,
    "stopping distance, simulated in proportion to speed (datasets)": braking,
    "hill races, simulated in proportion to the way (MASS)": hills,
    "cherry trees, simulated as cones (datasets)": cones,
}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("folder", type=Path)
    options.add_argument("--out", type=Path, required=True)
    chosen = options.parse_args()
    stored = json.loads(chosen.out.read_text(encoding="utf-8")) if chosen.out.exists() else {}
    figures, inputs = stored.get("figures", {}), stored.get("inputs", {})
    for name, made in TABLES.items():
        if name in figures:
            continue
        file, began = FILES[made], time.process_time()
        result = mismatch_result(find_mismatch(made(chosen.folder)))
        held, unit = result.held_out_rms, result.unit
        followed = [one for one in result.levels.follows if one.answer in CORRECTS]
        laws = [f"{one.name}: {' + '.join(one.form.names) or 'law open'}" if one.form else one.name for one in followed]
        error = f"{held.as_simulated:.3g} → {held.after:.3g} {unit}" if held else ""
        seconds = f"{time.process_time() - began:.0f}"
        figures[name] = [str(result.levels.differs.answer), "; ".join(laws) or "no class follows", error, seconds]
        inputs[file] = hashlib.sha256((chosen.folder / file).read_bytes()).hexdigest()
        print(name, f"{seconds} s", *result.sentences(), sep="\n  ")  # noqa: T201
        chosen.out.write_text(
            json.dumps(_stored(figures, inputs), indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )


def _stored(figures: dict[str, list[str]], inputs: dict[str, str]) -> dict[str, object]:
    git = ["git", "rev-parse", "--short=8", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False)
    return {
        "question": "What do three levels answer of public recordings beside simple simulations?",
        "data": "Tables of Rafa7046/Non_Linear_Identification at e5c9b006 (the first 1,200, 1,024 and 1,000 rows), Rdatasets at a44de06f and cc03c296, NIST StRD.",
        "command": "python -m tests.diagnosis.table.public_tables FOLDER --out docs/validation/tables-public.json",
        "commit": commit.stdout.strip(),
        "date": datetime.now(UTC).date().isoformat(),
        "seed": "",
        "limits": "One recording each. Loads of the load cell only rise, so that a square of the load, which is known, and an integral of it are one curve. "
        "The time of Knock Hill is an hour too long. Naismith's rule is a line in the climb: the product that is named for the hills is another law.",
        "columns": ["differs", "follows or goes on, and law", "held-out error", "processor time [s]"],
        "figures": figures,
        "inputs": inputs,
    }


if __name__ == "__main__":
    main()
