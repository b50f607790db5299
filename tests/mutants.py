"""What tests detect: sampled mutants of the package, each against the tests of its own folder.

    python -m tests.mutants --count 300 --seed 1 --out mutants.csv [--workers 2]

A mutant is a copy of the package in which one operator, comparison, number, condition or returned value is another
[DeMillo, Lipton and Sayward, Computer 11 (1978) 34]. It is killed where a test fails. The default tier runs first, then the
slow one, with `--nightly` that one too, so that the table shows what the default tier alone would miss. Rows that the file has are not run again: a
study that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import ast
import copy
import csv
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

import numpy as np

ROOT = Path(__file__).parents[1]
PACKAGE = "dbbstation"

TIERS = {"default": "not slow and not nightly", "slow": "slow and not nightly", "nightly": "nightly"}
LONGEST_S = 1500.0
"""A run of tests that takes longer is one that the mutant made endless: killed."""

OTHERS = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
"""What takes the place of an operator."""

FIELDS = ("file", "line", "what", "killed_by", "seconds")


@dataclass(frozen=True)
class Mutant:
    """One change: file below the package, place in the order of the file's changeable nodes, line, and what it does."""

    file: str
    place: int
    line: int
    what: str


def places(tree: ast.Module) -> list[ast.AST]:
    """Nodes that can be changed, without annotations and docstrings, in the order of the file."""
    found: list[ast.AST] = []
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if changed(node) is not None:
            found.append(node)
        for field, value in ast.iter_fields(node):
            if field in {"annotation", "returns", "decorator_list"}:
                continue
            waiting += [one for one in (value if isinstance(value, list) else [value]) if isinstance(one, ast.AST)]
    return sorted(found, key=lambda node: (getattr(node, "lineno", 0), getattr(node, "col_offset", 0)))


def changed(node: ast.AST) -> ast.AST | None:
    """Return the node as another, a copy; None where nothing is changed."""
    other = copy.deepcopy(node)
    if isinstance(other, ast.BinOp | ast.BoolOp) and type(other.op) in OTHERS:
        other.op = OTHERS[type(other.op)]()
    elif isinstance(other, ast.Compare) and type(other.ops[0]) in OTHERS:
        other.ops[0] = OTHERS[type(other.ops[0])]()
    elif isinstance(other, ast.Constant) and isinstance(other.value, bool):
        other.value = not other.value
    elif isinstance(other, ast.Constant) and isinstance(other.value, int | float):
        other.value = other.value + 1 if isinstance(other.value, int) else 1.5 * other.value + (other.value == 0.0)
    elif isinstance(other, ast.UnaryOp) and isinstance(other.op, ast.Not):
        return other.operand
    elif isinstance(other, ast.Return) and other.value is not None and not isinstance(other.value, ast.Constant):
        other.value = ast.copy_location(ast.Constant(None), other.value)
    else:
        return None
    return other


class _Exchange(ast.NodeTransformer):
    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self._old, self._new = old, new

    def visit(self, node: ast.AST) -> ast.AST:
        return self._new if node is self._old else self.generic_visit(node)


def sampled(count: int, seed: int) -> list[Mutant]:
    """Draw mutants, every changeable place of the package alike."""
    every = []
    for path in sorted((ROOT / PACKAGE).rglob("*.py")):
        tree = ast.parse(path.read_text())
        file = str(path.relative_to(ROOT / PACKAGE))
        for place, node in enumerate(places(tree)):
            other = changed(node)
            assert other is not None
            what = f"{ast.unparse(node)[:60]} -> {ast.unparse(other)[:60]}".replace("\n", " ")
            every.append(Mutant(file, place, getattr(node, "lineno", 0), what))
    chosen = np.random.default_rng(seed).permutation(len(every))[:count]
    return [every[k] for k in chosen]


def tests_of(file: str) -> list[str]:
    """Folders of tests that mirror the folder of a file; those of the commands for files without one."""
    folder = Path(file).parent
    while str(folder) != "." and not (ROOT / "tests" / folder).is_dir():
        folder = folder.parent
    if str(folder) == ".":
        return ["tests/cli"]
    return [f"tests/{folder}"] + (["tests/cli"] if folder.parts[0] == "cli" else [])


def killed_by(mutant: Mutant, tiers: list[str], workplace: Path) -> str:
    """First tier whose tests fail with a mutant, or `survived`."""
    path = workplace / PACKAGE / mutant.file
    original = path.read_text()
    tree = ast.parse(original)
    node = places(tree)[mutant.place]
    other = changed(node)
    assert other is not None
    path.write_text(ast.unparse(ast.fix_missing_locations(_Exchange(node, other).visit(tree))))
    try:
        return next((tier for tier in tiers if _fails(mutant.file, TIERS[tier], workplace)), "survived")
    finally:
        path.write_text(original)


def _fails(file: str, tier: str, workplace: Path) -> bool:
    """Whether a test of the tier fails; no test there is no failure."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-m", tier, *tests_of(file)]
    environment = {**os.environ, "PYTHONPATH": str(workplace), "NUMBA_CACHE_DIR": str(workplace / "compiled")}
    tests = subprocess.Popen(
        command,
        cwd=workplace,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return tests.wait(LONGEST_S) not in {0, 5}
    except subprocess.TimeoutExpired:
        return True
    finally:
        if tests.poll() is None:
            os.killpg(tests.pid, signal.SIGKILL)
            tests.wait()


def main() -> None:
    """Run what the file has not, and print the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=300)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--nightly", action="store_true")
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    if not chosen.out.exists():
        chosen.out.write_text(",".join(FIELDS) + "\n")
    with chosen.out.open(newline="") as file:
        known = {(row["file"], row["line"], row["what"]) for row in csv.DictReader(file)}
    tiers = list(TIERS) if chosen.nightly else list(TIERS)[:2]
    mutants = sampled(chosen.count, chosen.seed)
    mutants = [one for one in mutants if (one.file, str(one.line), one.what) not in known]
    writing = Lock()
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(chosen.workers) as workers:
        free = []
        for number in range(chosen.workers):
            free.append(Path(temporary) / str(number))
            shutil.copytree(ROOT, free[-1], ignore=shutil.ignore_patterns(".venv", "_build", "__pycache__", ".*_cache"))

        def run(mutant: Mutant) -> None:
            workplace = free.pop()
            began = time.monotonic()
            by = killed_by(mutant, tiers, workplace)
            free.append(workplace)
            with writing, chosen.out.open("a", newline="") as file:
                took = f"{time.monotonic() - began:.0f}"
                csv.writer(file).writerow([mutant.file, mutant.line, mutant.what, by, took])

        for done in as_completed([workers.submit(run, mutant) for mutant in mutants]):
            done.result()
    with chosen.out.open(newline="") as file:
        print(Counter(row["killed_by"] for row in csv.DictReader(file)))  # noqa: T201


if __name__ == "__main__":
    main()
