"""How much depends on three constants of the levels: margin of a size, share of interchangeable effects, odds of a driven column.

    python -m tests.diagnosis.table.levels_constants --seeds 31,32 --out docs/validation/constants-of-levels.json

Tables are those of `levels_study`, one beginning of the noise, no parts held back. Each constant is halved and doubled, or about so. Results are
kept in the file, and rows that are there are not run again.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from unittest import mock

import numpy as np

from dbbstation.inference import patterns
from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.followed import VariableProbabilities, classes_of, probability_of_any
from dbbstation.inference.forms import Spline
from dbbstation.inference.levels import SURE, TIME
from dbbstation.inference.levels_of import MARGIN, detectable
from dbbstation.inference.settle import Beginning, settle
from tests.diagnosis.table.levels_study import EFFECTS, SAME, interval, table_of

MARGINS, SHARES, ODDS = (1.0, 1.25, 1.5), (0.8, 0.9, 0.95), (4.0, 19.0, 99.0)
DRIVEN = ("bend", "growth", "play", "creep")
"""Effects beside which a column is put that results from them."""


def settled_of(table):
    """What the comparison of a table comes to from one beginning of the noise."""
    return settle(table.channel(), thorough=False, beginnings=(Beginning.EVERYTHING,))


def found_at(kind: str, seed: int) -> dict[str, bool]:
    """Whether a smooth curve of the size that is stated, by margin, is found in the twin."""
    twin = table_of(kind, seed, 0.0)
    usable = [one for one in detectable(settled_of(twin)) if one.size and one.follows not in {TIME, "simulated_um"}]
    rng = np.random.default_rng([20261129, list(EFFECTS).index(kind), seed])
    one = usable[int(rng.integers(len(usable)))]
    variable = next(v for v in twin.variables if v.name == one.follows)
    curve = Spline(variable.low, variable.high, 7).columns(variable.values) @ rng.standard_normal(7)
    curve = (curve - curve.mean()) / curve.std()
    found = {}
    for margin in MARGINS:
        added = curve * float(one.size or 0.0) * margin / MARGIN
        found[str(margin)] = probability_of_any(settled_of(replace(twin, measured=twin.measured + added))) >= SURE
    return found


def named_at(kind: str, seed: int) -> dict[str, bool]:
    """Whether, by share, a class names a variable besides those that are followed."""
    settled, found = settled_of(table_of(kind, seed, 2.0)), {}
    for share in SHARES:
        one = replace(settled, channel=replace(settled.channel, interchangeable=share))
        classes = classes_of(one, VariableProbabilities(one))
        others = {SAME.get(v, v) for one in classes for v in one.others} - EFFECTS[kind][2]
        found[str(share)] = bool(others)
    return found


def cause_first_at(kind: str, seed: int) -> dict[str, bool]:
    """Whether, by odds, the cause is followed and not a marked column that results from the effect, known to half of the noise."""
    table = table_of(kind, seed, 2.0)
    plain = table_of(kind, seed, 0.0)
    effect, rng = table.measured - plain.measured, np.random.default_rng([20261130, seed])
    values = effect + 0.5 * rng.standard_normal(len(effect))
    found = {}
    for odds in ODDS:
        with mock.patch.object(patterns, "DRIVEN_ODDS", -float(np.log(odds))):
            driven = Variable("torque_n_m", "N m", Kind.FORCE, values, driven=True)
            settled = settled_of(replace(table, variables=(*table.variables, driven)))
            sure = VariableProbabilities(settled)
            found[str(odds)] = sure.of(["torque_n_m"]) < SURE <= sure.of([*EFFECTS[kind][2], "simulated_um"])
    return found


ASKED = {"margin": found_at, "interchangeable": named_at, "driven": cause_first_at}


def figures(rows: list[dict[str, object]]) -> dict[str, list[object]]:
    """Rates by constant and value."""
    found: dict[str, list[object]] = {}
    told = {
        "margin": "effects found at the size with margin",
        "interchangeable": "tables that name a further variable at share",
        "driven": "tables with the cause and not its consequence at odds",
    }
    for constant, text in told.items():
        own = [row["found"] for row in rows if row["constant"] == constant]
        for value in dict(own[0]) if own else ():
            count = sum(bool(one[value]) for one in own)
            found[f"{text} {value}"] = [count, len(own), interval(count, len(own))]
    return found


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seeds", default="31,32")
    options.add_argument("--out", type=Path, required=True)
    chosen = options.parse_args()
    stored = json.loads(chosen.out.read_text(encoding="utf-8")) if chosen.out.exists() else {"tables": []}
    rows = stored["tables"]
    known = {(row["constant"], row["kind"], row["seed"]) for row in rows}
    for seed in map(int, chosen.seeds.split(",")):
        for constant, ask in ASKED.items():
            for kind in DRIVEN if constant == "driven" else EFFECTS:
                if (constant, kind, seed) not in known:
                    rows.append({"constant": constant, "kind": kind, "seed": seed, "found": ask(kind, seed)})
                    chosen.out.write_text(json.dumps(_stored(rows), indent=1) + "\n", encoding="utf-8")
    print(json.dumps(figures(rows), indent=1))  # noqa: T201


def _stored(rows: list[dict[str, object]]) -> dict[str, object]:
    git = ["git", "rev-parse", "--short=8", "HEAD"]
    return {
        "question": "How much depends on the margin of a size, the share of interchangeable effects and the odds of a driven column?",
        "data": "Tables of a simulated press, one beginning of the noise, no parts held back.",
        "command": "python -m tests.diagnosis.table.levels_constants --seeds 31,32 --out docs/validation/constants-of-levels.json",
        "commit": subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip(),
        "date": datetime.now(UTC).date().isoformat(),
        "seed": ",".join(sorted({str(row["seed"]) for row in rows}, key=int)),
        "limits": "A sample: the command goes on where the file ends.",
        "columns": ["tables", "of", "95 % interval"],
        "figures": figures(rows),
        "tables": rows,
    }


if __name__ == "__main__":
    main()
