"""Sound sessions of the plant, and single runs of them spoilt by a known amount.

`python -m tests.quality.sabotage` prints the table of docs/validation.md: how often each finding is made of runs that are spoilt by
half its limit, by its limit and by twice its limit, and how often of runs that are sound. `--equipment 3` prints the table of what goes
wrong with balls, programs and gauges, `--strange` that of faults of other kinds, `--shared 4` of faults that all runs share, `--limits 5` the limits of sound runs, and `--drifting 1000` how often good circles on drifting days have a finding, with `--model` of
machines with a model.
"""

from __future__ import annotations

import argparse
import collections
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from dbbstation.computing.threads import with_one_thread
from dbbstation.quality.all_runs import bar_of_all, programs_of_all
from dbbstation.quality.finding import Finding, FindingVerdict
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.knowledge import Seen
from tests.quality.equipment import Row, equipment, print_equipment
from tests.quality.sessions import TESTS, calibrated, drifting_session, sound, spoilt
from tests.quality.shares import spoil
from tests.quality.spoilers import SPOILERS, larger, mirrored
from tests.quality.strange import mirror_image, print_later, print_strange


def false_alarms(folder: Path, seed: int, wanted: int, *, with_model: bool) -> None:
    """Good circles on drifting days, each judged at the machine, beside those before it, and in the end, beside all."""
    seen_so_far = 0
    alarms: dict[str, collections.Counter[str]] = {
        "at the machine": collections.Counter(),
        "in the end": collections.Counter(),
    }
    while seen_so_far < wanted:
        whole = drifting_session(folder / f"drift{seed}", seed, with_model=with_model)
        session = SessionRuns(whole.runs)
        for k, one in enumerate(whole.runs[: wanted - seen_so_far]):
            live = SessionRuns(whole.runs[: k + 1]).judge(one)
            for name, judged in (("at the machine", live), ("in the end", session.judge(one))):
                alarms[name]["circles"] += bool(judged.wrong)
                alarms[name].update(str(f.name) for f in judged.wrong)
                for f in judged.wrong:
                    sys.stderr.write(f"{seed} {name} {one.run.label}: {f.name} {f.value} > {f.limit}: {f.text}\n")
        seen_so_far += min(len(whole.runs), wanted - seen_so_far)
        seed += 1
    for name, counted in alarms.items():
        sys.stdout.write(f"{wanted} good circles on drifting days, {name}: {dict(counted)}\n")


def limits(folder: Path, seeds: range, *, with_model: bool) -> None:
    """From what to what the limits of sound runs go, of the first direction of a test and of the second, beside nothing else."""
    found: dict[tuple[str, str], list[float]] = collections.defaultdict(list)
    for seed in seeds:
        at = folder / f"{seed}{with_model}"
        whole = calibrated(at, seed) if with_model else sound(at, seed, TESTS)
        first = [one for one in whole.runs if one.run.repeat == 1]
        for k, one in enumerate(first):
            pair = first[k - 1 : k + 1] if k % 2 else [one]
            for each in SessionRuns(pair).judge(one).findings:
                if each.limit is not None:
                    found[each.name, "second" if k % 2 else "first"].append(each.limit)
    for (name, direction), sizes in found.items():
        sizes.sort()
        middle = sizes[len(sizes) // 2]
        by = "with a model" if with_model else "without a model"
        sys.stdout.write(
            f"{name}, {direction} direction, {by}: {sizes[0]:.2f} to {sizes[-1]:.2f}, median {middle:.2f}, of {len(sizes)}\n"
        )


def shared(folder: Path, seeds: range) -> None:
    """How much likelier all runs are if what all of them share is wrong, behind 2, 3, 4, 6 and 8 tests, as logarithms."""
    for seed in seeds:
        whole = sound(folder / f"shared{seed}", seed, TESTS, rate_hz=20.0)
        first = [one for one in whole.runs if one.run.repeat == 1]
        for um in (0.0, 10.0, 20.0, 30.0, 40.0, 50.0):
            runs = [spoilt(one, larger, um) for one in first]
            _print_shared(f"{seed} bar {um:.0f} µm", runs, lambda some: bar_of_all(some, by_model=False))
        for name, spoiler, size in (("wrong way round", mirrored, 1.0), ("mirrored in X", mirror_image, 0.0)):
            _print_shared(f"{seed} {name}", [spoilt(one, spoiler, size) for one in first], programs_of_all)


def _print_shared(name: str, runs: list[Seen], ask: Callable[[list[Seen]], Finding]) -> None:
    asked = {tests: ask(runs[: 2 * tests]) for tests in (2, 3, 4, 6, 8)}
    told = ", ".join(f"{tests} tests {0.0 if one.value is None else one.value:.1f}" for tests, one in asked.items())
    sys.stdout.write(f"{name}: {told}, limit {asked[8].limit}\n")


@with_one_thread
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clean", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drifting", type=int, default=0, help="good circles on drifting days, in place of all else")
    parser.add_argument("--model", action="store_true", help="each good session has its own calibration as a model")
    parser.add_argument("--equipment", type=int, default=0, help="sessions whose equipment fails, in place of all else")
    parser.add_argument("--strange", action="store_true", help="faults of other kinds, in place of all else")
    parser.add_argument(
        "--only", default="", help="of the faults of other kinds those that match, as `all runs|ball with`"
    )
    parser.add_argument(
        "--later", action="store_true", help="of these faults only those behind other tests, without a model"
    )
    parser.add_argument(
        "--shared", type=int, default=0, help="sessions of which all runs share a fault, in place of all else"
    )
    parser.add_argument("--limits", type=int, default=0, help="sessions whose limits are listed, in place of all else")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if given.drifting:
            false_alarms(Path(folder), given.seed, given.drifting, with_model=given.model)
        for with_model in (False, True) if given.limits else ():
            limits(Path(folder), range(1000 + given.seed, 1000 + given.seed + given.limits), with_model=with_model)
        if given.shared:
            shared(Path(folder), range(1000 + given.seed, 1000 + given.seed + given.shared))
        if given.strange:
            (print_later if given.later else print_strange)(Path(folder), 1000 + given.seed, given.only)
        counted: Row = collections.Counter()
        for seed in range(given.seed, given.seed + given.equipment):
            counted.update(equipment(Path(folder) / str(seed), 1000 + seed))
        if given.equipment:
            print_equipment(counted)
    if not (given.drifting or given.equipment or given.strange or given.shared or given.limits):
        findings(given.seed, given.clean)


def findings(first_seed: int, clean: int) -> None:
    """Findings of sound circles, and of one run that is spoilt by shares of each limit."""
    wrong: collections.Counter[str] = collections.Counter()
    untold: collections.Counter[str] = collections.Counter()
    seen = alarmed = 0
    with tempfile.TemporaryDirectory() as folder:
        seed = first_seed
        while seen < clean:
            whole = sound(Path(folder) / f"clean{seed}", seed)
            for judgement in whole.judged()[: clean - seen]:
                seen += 1
                alarmed += bool(judgement.wrong)
                wrong.update(f"{f.name}" for f in judgement.wrong)
                untold.update(f"{f.name}" for f in judgement.findings if f.verdict is FindingVerdict.CANNOT_TELL)
                for f in judgement.wrong:
                    sys.stderr.write(f"{seed} {judgement.run.label}: {f.name} {f.value} > {f.limit}: {f.text}\n")
            seed += 1
        sys.stdout.write(
            f"{seen} sound circles: {alarmed} with a finding; {dict(wrong)}; cannot tell: {dict(untold)}\n"
        )
        whole = calibrated(Path(folder), 1000 + first_seed)
        repeated = next(k for k, one in enumerate(whole.runs) if one.run.label == "h ccw 2")
        for name in SPOILERS:
            for one in spoil(whole, repeated, name):
                value = "-" if one.value is None else f"{one.value:.2f}"
                sys.stdout.write(
                    f"{name:16} {one.share:3} limit {one.limit:9.2f} value {value:>9} {one.verdict:12} {', '.join(one.also)}\n"
                )


if __name__ == "__main__":
    main()
