"""Sixty sessions of machines with laws of their own, diagnosed by any commit, and the score of each.

python -m tests.plant.foreign make FOLDER --seed 48 --count 60
python -m tests.plant.foreign run FOLDER CHECKOUT --only 1-40
python -m tests.plant.foreign score FOLDER COMMIT ... --only 1-40 --out docs/validation/sixty.json

All can be resumed: what exists is not made again. A checkout of another commit: `git worktree add --detach PATH COMMIT`.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from tests.diagnosis.foreign_levels import calibration_of, table_of
from tests.plant.foreign.judge import causes_of, commit_of, judge
from tests.plant.foreign.score import as_table, scored
from tests.plant.foreign.sessions import make

LIMITS = "Each commit judged another number of sessions; the command goes on where it ended."


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.plant.foreign", description=__doc__.splitlines()[0])
    parser.add_argument("task", choices=("make", "run", "score"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("of", nargs="*", help="run: one checkout; score: commits that were run")
    parser.add_argument("--seed", type=int, default=48, help="of everything")
    parser.add_argument("--count", type=int, default=60, help="sessions")
    parser.add_argument(
        "--wide", action="store_true", help="make: four robots, up to four causes, a fifth of them clean"
    )
    parser.add_argument("--true", action="store_true", help="run: with the causes that were put in, and no others")
    parser.add_argument("--only", default="", help="sessions to run or score, in this order, as in 12,3,20-40")
    parser.add_argument("--former", type=Path, help="score: an earlier score, for commits whose verdicts are gone")
    parser.add_argument("--limits", default=LIMITS, help="score: what the stored table says of its limits")
    parser.add_argument("--out", type=Path, help="score: write the figures here as JSON, too")
    parser.add_argument(
        "--levels", type=Path, help="score: write recall and precision of each level here, of one commit"
    )
    parser.add_argument("--calibration", type=Path, help="score: write how often the levels' probabilities come true")
    parser.add_argument("--diagram", type=Path, help="score: draw that here as SVG")
    given = parser.parse_args()
    numbers = _numbers(given.only) or list(range(1, given.count + 1))
    if given.task == "make":
        for number in range(1, given.count + 1):
            make(given.folder, given.seed, number, wide=given.wide)
            sys.stderr.write(f"{number} of {given.count} sessions\n")
    elif given.task == "run":
        checkout = Path(given.of[0]).resolve() if given.of else Path.cwd()
        commit = commit_of(checkout)
        for number in numbers:
            causes = causes_of(given.folder, f"{number:04d}") if given.true else None
            if given.true and not causes:
                continue
            verdict = judge(given.folder, checkout, commit, f"{number:04d}", causes)
            sys.stderr.write(f"{commit} {number:04d} {verdict['processor_s']:.0f} s, {verdict['memory_mb']:.0f} MB\n")
    else:
        figures = scored(given.folder, given.of, [f"{number:04d}" for number in numbers], given.seed, given.former)
        sys.stdout.write(_text(figures))
        if given.out:
            given.out.parent.mkdir(parents=True, exist_ok=True)
            given.out.write_text(_text(as_table(figures, given.limits)), encoding="utf-8")
        head, each = {key: figures[key] for key in ("date", "seed")}, figures["commits"][given.of[0]]["each"]
        if given.levels:
            head["command"] = "python -m tests.plant.foreign make|run|score FOLDER --levels FILE"
            given.levels.write_text(_text(table_of(each, head, given.limits)), encoding="utf-8")
        if given.calibration and given.diagram:
            head["command"] = "python -m tests.plant.foreign make|run|score FOLDER --calibration FILE --diagram FILE"
            table, drawn = calibration_of(each, head)
            given.calibration.write_text(_text(table), encoding="utf-8")
            given.diagram.write_bytes(drawn)


def _text(figures: dict[str, Any]) -> str:
    return json.dumps(figures, indent=1, ensure_ascii=False) + "\n"


def _numbers(text: str) -> list[int]:
    spans = [part.split("-") for part in text.split(",") if part]
    return [number for span in spans for number in range(int(span[0]), int(span[-1]) + 1)]


if __name__ == "__main__":
    main()
