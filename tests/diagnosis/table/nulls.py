"""Tables under eight kinds of noise in which nothing is missing, or one effect: what is named in the first is false.

    python -m tests.diagnosis.table.nulls --count 60 --seed 1 --out nulls.csv [--kinds walk,jitter] [--sizes 0.5,1,3]

Sizes are root mean squares of an effect over that of the noise; with them each table has one of `EFFECTS`. Rows of a file that is
there are not run again: a study that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.levels import Verdict

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.inference.read_off import CauseFinding


@dataclass(frozen=True, eq=False)
class Moving:
    """Variables of a moving axis, one value a row.

    Attributes:
        t: time [s].
        place: of the axis [mm].
        angle: of its screw [deg].
        load: force [N].
        oil: temperature [degC].
    """

    t: NDArray[np.float64]
    place: NDArray[np.float64]
    angle: NDArray[np.float64]
    load: NDArray[np.float64]
    oil: NDArray[np.float64]

    @property
    def speed(self) -> NDArray[np.float64]:
        speed = np.gradient(self.place, self.t)
        return np.asarray(speed / np.sqrt(np.mean(speed**2)))


def moving(rng: np.random.Generator, rows: int) -> Moving:
    """Draw a motion: two sines of place, a turning screw, a load that changes slowly, and oil that warms up."""
    t = np.arange(rows) * float(rng.choice([0.01, 0.05, 0.2]))
    span = t[-1]

    def sines(cycles: tuple[float, float], count: int) -> NDArray[np.float64]:
        total = np.zeros(rows)
        for _ in range(count):
            total += rng.uniform(0.4, 1.0) * np.sin(
                2.0 * np.pi * rng.uniform(*cycles) * t / span + rng.uniform(0.0, 6.3)
            )
        return total

    place = 40.0 * sines((3.0, 9.0), 2)
    load = 300.0 * sines((1.0, 4.0), 2)
    oil = 22.0 + rng.uniform(2.0, 8.0) * (1.0 - np.exp(-t / (span * rng.uniform(0.2, 0.8))))
    return Moving(t, place, np.mod(360.0 * place / 20.0, 360.0), load, oil + rng.normal(0.0, 0.03, rows))


def _white(rng: np.random.Generator, axis: Moving) -> NDArray[np.float64]:
    return rng.standard_normal(len(axis.t))


def _first_order(rng: np.random.Generator, axis: Moving) -> NDArray[np.float64]:
    return _filtered(rng, axis, [1.0], [1.0, -0.9])


def _low_passed(rng: np.random.Generator, axis: Moving) -> NDArray[np.float64]:
    """Averaged over 21 rows, evenly or with the weights of a Hann window, once or to and fro."""
    window = np.full(21, 1.0) if rng.random() < 0.5 else np.hanning(23)[1:-1]
    if rng.random() < 0.5:
        window = np.convolve(window, window)
    return _filtered(rng, axis, window, [1.0])


def _resonant(rng: np.random.Generator, axis: Moving) -> NDArray[np.float64]:
    """Poles of radius 0.97 at a twelfth of the sampling rate."""
    return _filtered(rng, axis, [1.0], [1.0, -2.0 * 0.97 * np.cos(2.0 * np.pi / 12.0), 0.97**2])


def _walk(rng: np.random.Generator, axis: Moving) -> NDArray[np.float64]:
    return np.cumsum(rng.standard_normal(len(axis.t))) + 2.0 * rng.standard_normal(len(axis.t))


def _long_tails(rng: np.random.Generator, axis: Moving) -> NDArray[np.float64]:
    return rng.standard_t(3.0, len(axis.t))


def _grows_with_speed(rng: np.random.Generator, axis: Moving) -> NDArray[np.float64]:
    return rng.standard_normal(len(axis.t)) * np.hypot(0.2, axis.speed)


def _jitter(rng: np.random.Generator, axis: Moving) -> NDArray[np.float64]:
    """The clock of the recording is off by a random time in each row: an error in proportion to the speed."""
    return axis.speed * rng.standard_normal(len(axis.t)) + 0.3 * rng.standard_normal(len(axis.t))


def _filtered(rng: np.random.Generator, axis: Moving, b: object, a: object) -> NDArray[np.float64]:
    return np.asarray(lfilter(b, a, rng.standard_normal(len(axis.t) + 400))[400:])


NOISES: dict[str, Callable[[np.random.Generator, Moving], NDArray[np.float64]]] = {
    "white": _white,
    "first-order": _first_order,
    "low-passed": _low_passed,
    "resonant": _resonant,
    "walk": _walk,
    "long-tails": _long_tails,
    "speed": _grows_with_speed,
    "jitter": _jitter,
}


DIGITS = 4
"""Of a recorded value [mm]: a two-hundredth of the noise."""


def _linear(axis: Moving) -> NDArray[np.float64]:
    return axis.oil


def _hysteresis(axis: Moving) -> NDArray[np.float64]:
    return np.sign(np.gradient(axis.place))


def _twice(axis: Moving) -> NDArray[np.float64]:
    return np.cos(np.radians(2.0 * axis.angle) + 0.7)


def _product(axis: Moving) -> NDArray[np.float64]:
    return axis.place * axis.load


def _pulse(axis: Moving) -> NDArray[np.float64]:
    rows = len(axis.t)
    return ((np.arange(rows) >= 0.4 * rows) & (np.arange(rows) < 0.5 * rows)).astype(np.float64)


EFFECTS: dict[str, tuple[Callable[[Moving], NDArray[np.float64]], tuple[str, ...]]] = {
    "linear": (_linear, ("oil_temp_c",)),
    "hysteresis": (_hysteresis, ("hysteresis of place_mm", "hysteresis of simulated_mm")),
    "twice": (_twice, ("twice per turn of screw_deg",)),
    "product": (_product, ("product of place_mm and load_n", "product of load_n and simulated_mm")),
    "pulse": (_pulse, ("pulses", "curve over t_s")),
}
"""What a table may lack, and how a right name of it begins or what it has in it."""


def null_table(kind: str, seed: int, effect: str = "", size: float = 0.0) -> Table:
    """Return a table whose measured value differs from the simulated one by noise, a constant, and an effect if one is named."""
    rng = np.random.default_rng([seed, list(NOISES).index(kind)])
    rows = int(rng.integers(300, 1001))
    axis = moving(rng, rows)
    noise = NOISES[kind](rng, axis)
    simulated = axis.place + 0.1 * axis.load
    measured = simulated + 0.02 * noise / np.std(noise) + rng.normal(0.0, 0.05)
    if effect:
        missing = EFFECTS[effect][0](axis)
        measured = measured + 0.02 * size * (missing - missing.mean()) / np.std(missing)
    return table_of(axis, np.round(measured, DIGITS), np.round(simulated, DIGITS))


def table_of(axis: Moving, measured: NDArray[np.float64], simulated: NDArray[np.float64]) -> Table:
    clock = Variable("t_s", "s", Kind.TIME, axis.t)
    variables = (
        clock,
        Variable("place_mm", "mm", Kind.LENGTH, axis.place),
        Variable("screw_deg", "deg", Kind.ANGLE, axis.angle, 360.0),
        Variable("load_n", "N", Kind.FORCE, axis.load),
        Variable("oil_temp_c", "degC", Kind.TEMPERATURE, axis.oil),
    )
    return Table(
        measured=measured,
        simulated=simulated,
        unit="mm",
        simulated_name="simulated_mm",
        variables=variables,
        derivatives={},
        columns={},
        blocks=(slice(0, len(measured)),),
        names=("run",),
        clock=clock,
    )


def named_in(
    kind: str, seed: int, effect: str = "", size: float = 0.0, *, hold_out: bool = True
) -> dict[str, CauseFinding]:
    """What these rows surely show of a table, by name; parts are held out only where that decides a verdict."""
    table = null_table(kind, seed, effect, size)
    found = find_mismatch(table, hold_out=False)
    if hold_out and found.identified:
        found = find_mismatch(table)
    return {one.name: one for one in found.findings if one.verdict.rank < Verdict.AMBIGUOUS.rank}


def identified_in(kind: str, seed: int, effect: str = "", size: float = 0.0, *, hold_out: bool = True) -> list[str]:
    named = named_in(kind, seed, effect, size, hold_out=hold_out)
    return [name for name, one in named.items() if one.verdict is Verdict.IDENTIFIED]


def _row(kind: str, seed: int, effect: str, size: float) -> dict[str, object]:
    """Row of the file: names by verdict, and of those that held-out parts decide, in how many parts each gained, - where not in sum
    without the best part."""
    began = time.process_time()
    named = named_in(kind, seed, effect, size)
    gained = [one.gains for one in named.values() if one.gains is not None and one.verdict is not Verdict.HAPPENED]
    return {
        "kind": kind,
        "seed": seed,
        "effect": effect,
        "size": size,
        **{str(v): "; ".join(name for name, one in named.items() if one.verdict is v) for v in TOLD},
        "gained": "; ".join(f"{g.with_gain}{'+' if g.total > max(g.parts) else '-'}" for g in gained),
        "seconds": f"{time.process_time() - began:.1f}",
    }


TOLD = (Verdict.IDENTIFIED, Verdict.HAPPENED, Verdict.DOES_NOT_PREDICT)
COLUMNS = ("kind", "seed", "effect", "size", *map(str, TOLD), "gained", "seconds")


def is_right(name: str, effect: str) -> bool:
    return bool(effect) and any(own in name for own in EFFECTS[effect][1])


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=60)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--kinds", default=",".join(NOISES))
    options.add_argument("--sizes", default="0")
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--workers", type=int, default=os.cpu_count())
    chosen = options.parse_args()
    if not chosen.out.exists():
        chosen.out.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    wanted = [
        (kind, chosen.seed * 1000 + k, effect, size)
        for k in range(chosen.count)
        for kind in chosen.kinds.split(",")
        for size in map(float, chosen.sizes.split(","))
        for effect in (EFFECTS if size else ("",))
    ]
    with chosen.out.open(encoding="utf-8", newline="") as file:
        known = {(r["kind"], int(r["seed"]), r["effect"], float(r["size"])) for r in csv.DictReader(file)}
    with ProcessPoolExecutor(chosen.workers) as pool:
        running = [pool.submit(_row, *one) for one in wanted if one not in known]
        for done in as_completed(running):
            with chosen.out.open("a", encoding="utf-8", newline="") as file:
                csv.DictWriter(file, COLUMNS).writerow(done.result())
    with chosen.out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for kind, size in sorted({(row["kind"], row["size"]) for row in rows}, key=lambda one: (one[1], one[0])):
        own = [row for row in rows if (row["kind"], row["size"]) == (kind, size)]
        print(f"{kind:12} size {float(size):3g}: {len(own):4} tables, {', '.join(map(_told(own), TOLD))}")  # noqa: T201
    print(f"largest time {max((float(row['seconds']) for row in rows), default=0.0):.0f} s")  # noqa: T201


def _told(rows: Sequence[Mapping[str, str]]) -> Callable[[Verdict], str]:
    """Say of a verdict in how many tables it is given to a right name, and in how many to a false one."""

    def told(verdict: Verdict) -> str:
        named = [([n for n in row[verdict].split("; ") if n], row["effect"]) for row in rows]
        right = sum(any(is_right(name, effect) for name in names) for names, effect in named)
        false = sum(any(not is_right(name, effect) for name in names) for names, effect in named)
        return f"{verdict} {right} right {false} false"

    return told


if __name__ == "__main__":
    sys.exit(main())
