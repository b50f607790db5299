"""Tables with an effect and their twins without it: what each of three levels answers, and what is found at the size that is stated.

    python -m tests.diagnosis.table.levels_study --seeds 11,12,13,14,15 --out docs/validation/levels.json

Results are kept in the file, and rows that are there are not run again: a study that was interrupted goes on where it stopped. Effects follow
their variables at once, with a memory, or are concealed by parameters in part. With `injected`, an effect of the size from which the twin's
answer says that it is found is added to the twin. With `noise`, tables of a moving axis have ten kinds of noise and no effect.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.forms import Spline
from dbbstation.inference.levels import TIME, FollowsAnswer
from tests.diagnosis.table.nulls import NOISES, null_table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.diagnosis.table.nulls import Moving

NOISE_UM = 1.0
SIZES = (2.0,)
"""Root mean square of an effect before parameters take their part, over that of the noise."""


@dataclass(frozen=True, eq=False)
class Press:
    """A press that is moved, loaded and warmed, one value a row."""

    clock: NDArray[np.float64]
    stroke: NDArray[np.float64]
    force: NDArray[np.float64]
    room: NDArray[np.float64]
    pump: NDArray[np.float64]


def press(rng: np.random.Generator) -> Press:
    """Draw a motion: smooth random signals of different speeds, and a pump that is switched."""
    rows = int(rng.integers(350, 800))
    clock = np.arange(rows) * 0.5

    def smooth(memory: float) -> NDArray[np.float64]:
        drawn = rng.standard_normal(rows + 2000)
        kept = lfilter([1.0], [1.0, -2.0 * memory, memory**2], drawn)[2000:]
        return (kept - kept.mean()) / kept.std()

    pump = np.repeat(rng.integers(0, 5, rows // 20 + 1), 20)[:rows].astype(float)
    return Press(clock, 60.0 * smooth(0.93), 4.0 * smooth(0.9), 21.0 + 1.5 * smooth(0.97), pump)


def _late(values: NDArray[np.float64], rows: float) -> NDArray[np.float64]:
    decay = float(np.exp(-1.0 / rows))
    begun = [decay * values[0]]
    return lfilter([1.0 - decay], [1.0, -decay], values, zi=begun)[0]


Effect = Callable[[Press], "NDArray[np.float64]"]
EFFECTS: dict[str, tuple[str, Effect, frozenset[str]]] = {
    "bend": ("static", lambda p: (p.force - 2.0) ** 2, frozenset({"force_kn"})),
    "growth": ("static", lambda p: p.stroke * (p.room - 21.0), frozenset({"stroke_mm", "room_c"})),
    "play": ("static", lambda p: np.sign(np.gradient(p.stroke)), frozenset({"stroke_mm"})),
    "saturation": ("static", lambda p: np.tanh(p.force / 3.0), frozenset({"force_kn"})),
    "creep": ("memory", lambda p: _late(p.force, 12.0), frozenset({"force_kn"})),
    "warming": ("memory", lambda p: _late(p.pump, 25.0), frozenset({"pump_bar"})),
    "tank": ("memory", lambda p: np.cumsum(p.pump - p.pump.mean()), frozenset({"pump_bar", TIME})),
    "sag": ("concealed", lambda p: p.stroke + 0.6 * (p.stroke / 60.0) ** 2 * 60.0, frozenset({"stroke_mm"})),
    "column": (
        "concealed",
        lambda p: p.room - 21.0 + 0.02 * p.stroke * (p.room - 21.0),
        frozenset({"stroke_mm", "room_c"}),
    ),
    "load-path": ("concealed", lambda p: p.force + 0.4 * np.abs(p.force), frozenset({"force_kn"})),
}
"""What may be missing, of which kind, and the variables that it follows; a simulated value is the stroke."""

SAME = {"simulated_um": "stroke_mm"}

LAWS = {
    "bend": ("curve over force_kn",),
    "growth": ("product of stroke_mm and room_c", "linear in room_c", "linear in stroke_mm"),
    "play": ("hysteresis of stroke_mm", "hysteresis of simulated_um"),
    "saturation": ("saturation of force_kn", "curve over force_kn"),
    "creep": ("memory of force_kn",),
    "warming": ("memory of pump_bar",),
    "tank": ("integral of pump_bar",),
    "sag": ("curve over stroke_mm", "curve over simulated_um"),
    "column": ("product of stroke_mm and room_c", "linear in room_c", "linear in stroke_mm"),
    "load-path": ("curve over force_kn", "dead zone of force_kn"),
}
"""Names that are right of each: the law itself, and what contains it. A product about zeros that are neither ends nor middles has straight
lines beside it."""


def pink(rng: np.random.Generator, axis: Moving) -> NDArray[np.float64]:
    """Power in proportion to one over the frequency, down to a two-hundredth of a cycle a row."""
    spectrum = np.fft.rfft(rng.standard_normal(2 * len(axis.t)))
    frequency = np.maximum(np.fft.rfftfreq(2 * len(axis.t)), 0.005)
    return np.fft.irfft(spectrum / np.sqrt(frequency))[: len(axis.t)]


def hum(rng: np.random.Generator, axis: Moving) -> NDArray[np.float64]:
    """White noise and mains of as much power, whose phase wanders by a radian in a hundred rows."""
    phase = 2.0 * np.pi * 0.21 * np.arange(len(axis.t)) + np.cumsum(0.1 * rng.standard_normal(len(axis.t)))
    return rng.standard_normal(len(axis.t)) + np.sqrt(2.0) * np.sin(phase)


NOISES.update({"pink": pink, "hum": hum})


def table_of(kind: str, seed: int, size: float) -> Table:
    """Return a table in which one effect of this size is missing, or nothing; the twin has the same motion and noise."""
    rng = np.random.default_rng([20261127, list(EFFECTS).index(kind), seed])
    p = press(rng)
    noise = rng.standard_normal(len(p.clock) + 200)
    if seed % 2:
        noise = lfilter([1.0], [1.0, -0.6], noise) * 0.8
    effect = EFFECTS[kind][1](p)
    effect = size * NOISE_UM * (effect - effect.mean()) / effect.std()
    simulated = 12.0 * p.stroke
    derivatives = {}
    if EFFECTS[kind][0] == "concealed":
        derivatives = {"scale": p.stroke, "growth": p.room - 21.0, "compliance": p.force}
    clock = Variable("t_s", "s", Kind.TIME, p.clock)
    variables = (
        clock,
        Variable("stroke_mm", "mm", Kind.LENGTH, p.stroke),
        Variable("force_kn", "kN", Kind.FORCE, p.force),
        Variable("room_c", "degC", Kind.TEMPERATURE, p.room),
        Variable("pump_bar", "bar", Kind.ANY, p.pump),
    )
    measured = simulated + effect + NOISE_UM * noise[200:]
    rows = (slice(0, len(measured)),)
    return Table(measured, simulated, "um", "simulated_um", variables, derivatives, {}, rows, ("run",), clock)


def injected(kind: str, seed: int) -> tuple[Table, str, float] | None:
    """Twin with a smooth curve over a variable of the size from which its answer says that it is found; None where it says none."""
    twin = table_of(kind, seed, 0.0)
    sizes = find_mismatch(twin, hold_out=False).levels.differs.detectable
    rng = np.random.default_rng([20261128, list(EFFECTS).index(kind), seed])
    usable = [one for one in sizes if one.size is not None and one.follows not in {TIME, "simulated_um"}]
    if not usable:
        return None
    one = usable[int(rng.integers(len(usable)))]
    variable = next(v for v in twin.variables if v.name == one.follows)
    curve = Spline(variable.low, variable.high, 7).columns(variable.values) @ rng.standard_normal(7)
    added = float(one.size or 0.0) * (curve - curve.mean()) / curve.std()
    return replace(twin, measured=twin.measured + added), one.follows, float(one.size or 0.0)


def answer(kind: str, seed: int, what: str) -> dict[str, object]:
    truth, size = EFFECTS[kind][2] if kind in EFFECTS else frozenset(), 0.0
    if what == "noise":
        table = null_table(kind, 20_000 + seed)
    elif what == "injected":
        made = injected(kind, seed)
        if made is None:
            return {"kind": kind, "seed": seed, "what": what, "differs": "none"}
        table, follows, size = made
        truth = frozenset({follows})
    else:
        size = SIZES[0] if what == "effect" else 0.0
        table = table_of(kind, seed, size)
        truth = truth if what == "effect" else frozenset()
    began = time.process_time()
    found = find_mismatch(table)
    levels = found.levels
    located = [one for one in levels.follows if one.answer is FollowsAnswer.FOLLOWS]
    named = [{SAME.get(v, v) for each in one.variables for v in (*each, *one.or_variables)} for one in located]
    return {
        "kind": kind,
        "group": EFFECTS[kind][0] if kind in EFFECTS else "noise",
        "seed": seed,
        "what": what,
        "size": size,
        "rows": len(table),
        "differs": str(levels.differs.answer),
        "why": levels.differs.why,
        "follows": [one.name for one in located],
        "others": [f"{one.answer}: {one.name}" for one in levels.follows if one not in located],
        "laws": sorted({name for one in located if one.form for name in one.form.names}),
        "identified": [one.name for one in found.identified],
        "wrong_name": any(one.name not in LAWS.get(kind, ()) for one in found.identified) and what != "injected",
        "right": any(one & truth for one in named) or (TIME in truth and any(one.in_time for one in levels.follows)),
        "wrong": any(not one & (truth | {TIME}) for one in named),
        "correction": levels.correction,
        "seconds": round(time.process_time() - began, 1),
    }


def interval(count: int, of: int) -> str:
    """Wilson's 95 % interval of a rate."""
    if not of:
        return ""
    z, rate = 1.96, count / of
    middle = (rate + z**2 / (2 * of)) / (1 + z**2 / of)
    half = z * np.sqrt(rate * (1 - rate) / of + z**2 / (4 * of**2)) / (1 + z**2 / of)
    return f"{100.0 * max(middle - half, 0.0):.0f} to {100.0 * min(middle + half, 1.0):.0f} %"


def figures(rows: list[dict[str, object]]) -> dict[str, list[object]]:
    """Rates of the acceptance list, each with how many of how many and its interval."""

    def rate(what: str, holds: Callable[[dict[str, object]], bool], group: str = "") -> list[object]:
        own = [r for r in rows if r["what"] == what and r["differs"] != "none" and group in ("", r["group"])]
        count = sum(map(holds, own))
        return [count, len(own), interval(count, len(own))]

    return {
        "twin: yes": rate("twin", lambda r: r["differs"] == "yes"),
        "twin: no": rate("twin", lambda r: r["differs"] == "no"),
        "twin: a class follows": rate("twin", lambda r: bool(r["follows"])),
        "effect: yes": rate("effect", lambda r: r["differs"] == "yes"),
        "effect: no": rate("effect", lambda r: r["differs"] == "no"),
        "concealed: no": rate("effect", lambda r: r["differs"] == "no", "concealed"),
        "effect: right class": rate("effect", lambda r: bool(r["right"])),
        "effect: wrong class": rate("effect", lambda r: bool(r["wrong"])),
        "effect: a law is named": rate("effect", lambda r: bool(r["laws"])),
        "effect: a wrong name is identified": rate("effect", lambda r: bool(r.get("wrong_name"))),
        "noise: yes": rate("noise", lambda r: r["differs"] == "yes"),
        "noise: a class follows": rate("noise", lambda r: bool(r["follows"])),
        "random walk: no": rate("noise", lambda r: r["kind"] == "walk" and r["differs"] == "no"),
        "injected: yes": rate("injected", lambda r: r["differs"] == "yes"),
        "injected: no": rate("injected", lambda r: r["differs"] == "no"),
    }


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seeds", default="11,12,13")
    options.add_argument("--what", default="effect,twin,noise,injected")
    options.add_argument("--without", default="", help="kinds that are left out")
    options.add_argument("--out", type=Path, required=True)
    chosen = options.parse_args()
    stored = json.loads(chosen.out.read_text(encoding="utf-8")) if chosen.out.exists() else {"tables": []}
    rows: list[dict[str, object]] = stored["tables"]
    known = {(r["kind"], r["seed"], r["what"]) for r in rows}
    for seed in map(int, chosen.seeds.split(",")):
        for what in chosen.what.split(","):
            for kind in NOISES if what == "noise" else EFFECTS:
                if (kind, seed, what) in known or kind in chosen.without.split(","):
                    continue
                rows.append(answer(kind, seed, what))
                chosen.out.parent.mkdir(parents=True, exist_ok=True)
                chosen.out.write_text(json.dumps(_stored(rows, chosen.seeds), indent=1) + "\n", encoding="utf-8")
    print(json.dumps(figures(rows), indent=1))  # noqa: T201


def _stored(rows: list[dict[str, object]], seeds: str) -> dict[str, object]:
    return stored_table(
        rows,
        figures(rows),
        question="Do three levels of answer hold on tables with an effect of twice the noise, on their twins, and on ten kinds of noise?",
        data=f"{len(rows)} tables of a simulated press and a moving axis. Sizes are before fitted parameters take their part.",
        command=f"python -m tests.diagnosis.table.levels_study --seeds {seeds} --out docs/validation/levels.json",
        limits="A sample: the command goes on where the file ends.",
    )


def stored_table(
    rows: list[dict[str, object]],
    figures: dict[str, list[object]],
    *,
    question: str,
    data: str,
    command: str,
    limits: str,
) -> dict[str, object]:
    """What a study of tables stores: its figures with commit, date and seeds, and its rows, so that it can be resumed."""
    git = ["git", "rev-parse", "--short=8", "HEAD"]
    seconds = float(np.median([float(str(row.get("seconds", 0.0))) for row in rows]))
    return {
        "question": question,
        "data": data,
        "command": command,
        "commit": subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip(),
        "date": datetime.now(UTC).date().isoformat(),
        "seed": ",".join(sorted({str(row["seed"]) for row in rows}, key=int)),
        "limits": f"{limits} Median time {seconds:.1f} s of one processor.",
        "columns": ["tables", "of", "95 % interval"],
        "figures": figures,
        "tables": rows,
    }


if __name__ == "__main__":
    main()
