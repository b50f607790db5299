"""What tests detect: sampled mutants of the package, each against the tests of its own folder.

    python -m tests.mutants --count 300 --seed 1 --out mutants.csv [--workers 2]
    python -m tests.mutants --core --count 150 --near --out core.csv     # the core, as many of each of its parts

A mutant is a copy of the package in which one operator, comparison, number, condition or returned value is another
[DeMillo, Lipton and Sayward, Computer 11 (1978) 34]. It is killed where a test fails. The default tier runs first, then the
slow one, with `--nightly` that one too, so that the table shows what the default tier alone would miss.

Which tests run a line is recorded once, into a file beside the table (mutants.coverage), and a mutant is shown to these tests only.
Where none was seen to run it, as with constants of a module, compiled kernels and programs that a test starts, the whole folder
runs. With `--near` nothing is recorded: a mutant is shown to the test files that name its module, which takes
minutes in place of hours and lets more mutants live. Rows that the table has are not run again: a study that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import argparse
import ast
import copy
import csv
import os
import re
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
from coverage import CoverageData

ROOT = Path(__file__).parents[1]
PACKAGE = "dbbstation"

TIERS = {"default": "not slow and not nightly", "slow": "slow and not nightly", "nightly": "nightly"}
LONGEST_S = 900.0
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

CORE = {
    "kinematics": ("machine/", "model/"),
    "calibration": ("calibration/",),
    "engine": ("inference/", "diagnosis/"),
    "judging": ("quality/", "circles/", "station/judging.py"),
    "NC": ("nc/",),
    "files": ("files/",),
}
"""Parts of the core, by the beginnings of their files; every part gives as many mutants."""

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


def sampled(count: int, seed: int, *, core: bool) -> list[Mutant]:
    """Draw mutants, every changeable place of the package alike, or of the core, one part after the other."""
    drawn = np.random.default_rng(seed)
    every = changeable()
    if not core:
        return [every[k] for k in drawn.permutation(len(every))[:count]]
    parts = [[one for one in every if one.file.startswith(begins)] for begins in CORE.values()]
    orders = [drawn.permutation(len(part)) for part in parts]
    return [part[order[k]] for k in range(-(-count // len(parts))) for part, order in zip(parts, orders, strict=True)][
        :count
    ]


def changeable() -> list[Mutant]:
    every = []
    for path in sorted((ROOT / PACKAGE).rglob("*.py")):
        tree = ast.parse(path.read_text())
        file = str(path.relative_to(ROOT / PACKAGE))
        for place, node in enumerate(places(tree)):
            other = changed(node)
            assert other is not None
            what = f"{ast.unparse(node)[:60]} -> {ast.unparse(other)[:60]}".replace("\n", " ")
            every.append(Mutant(file, place, getattr(node, "lineno", 0), what))
    return every


def tests_of(file: str) -> list[str]:
    folder = Path(file).parent
    while str(folder) != "." and not (ROOT / "tests" / folder).is_dir():
        folder = folder.parent
    if str(folder) == ".":
        return ["tests/cli"]
    return [f"tests/{folder}"] + (["tests/cli"] if folder.parts[0] == "cli" else [])


def near(mutant: Mutant) -> list[str]:
    """Test files of a mutant's folder that name its module; of all folders where none does; the folder where nobody does."""
    module = ".".join((PACKAGE, *Path(mutant.file).with_suffix("").parts)).removesuffix(".__init__")
    named = re.compile(rf"{re.escape(module)}\b(?!\.)")
    files = (path for path in sorted((ROOT / "tests").rglob("test_*.py")) if named.search(path.read_text()))
    found = [str(path.relative_to(ROOT)) for path in files]
    folders = tests_of(mutant.file)
    own = [path for path in found if any(path.startswith(f"{folder}/") for folder in folders)]
    return own or found or folders


def record(out: Path, workplace: Path) -> None:
    settings = workplace / "coverage.ini"
    settings.write_text(f"[run]\nrelative_files = true\ndata_file = {out.resolve()}.part\n")
    options = [f"--cov={PACKAGE}", "--cov-context=test", "--cov-report=", f"--cov-config={settings}"]
    code = _run_tests([*options, "-n", "auto", "-m", "not nightly", "tests"], workplace, 4.0 * LONGEST_S)
    if code != 0:
        sys.exit(f"The tests do not pass without a mutant (exit code {code}): nothing can be said of mutants.")
    Path(f"{out.resolve()}.part").rename(out)


def running(mutant: Mutant, recorded: CoverageData) -> list[str]:
    """Return the tests of a mutant's folder that run its line; the folders where no test was seen to.

    Of a line that runs while a fixture is made, every test of the file counts: fixtures are shared.
    """
    folders = tests_of(mutant.file)
    path = next((path for path in recorded.measured_files() if Path(path) == Path(PACKAGE) / mutant.file), None)
    seen = set()
    for context in recorded.contexts_by_lineno(path).get(mutant.line, []) if path else []:
        test, _, phase = context.rpartition("|")
        if any(test.startswith(f"{folder}/") for folder in folders):
            seen.add(test if phase == "run" else test.partition("::")[0])
    return sorted(test for test in seen if "::" not in test or test.partition("::")[0] not in seen) or folders


def shown(mutants: list[Mutant], out: Path, workplace: Path) -> dict[Mutant, list[str]]:
    """Tests that run the line of each mutant, recorded beside the table where that was not done yet."""
    lines = out.with_suffix(".coverage")
    if not lines.exists():
        record(lines, workplace)
    recorded = CoverageData(str(lines))
    recorded.read()
    return {mutant: running(mutant, recorded) for mutant in mutants}


def killed_by(mutant: Mutant, tests: list[str], tiers: list[str], workplace: Path) -> str:
    path = workplace / PACKAGE / mutant.file
    original = path.read_text()
    tree = ast.parse(original)
    node = places(tree)[mutant.place]
    other = changed(node)
    assert other is not None
    path.write_text(ast.unparse(ast.fix_missing_locations(_Exchange(node, other).visit(tree))))
    try:
        for tier in tiers:
            if _fails(tests_of(mutant.file) if tier == "nightly" else tests, TIERS[tier], workplace):
                return tier
        return "survived"
    finally:
        path.write_text(original)


def _fails(tests: list[str], tier: str, workplace: Path) -> bool:
    named = workplace / "tests.txt"
    named.write_text("\n".join(tests))
    return _run_tests(["-x", "-p", "no:cacheprovider", "-m", tier, f"@{named}"], workplace) not in {
        0,
        5,
    }


def _run_tests(options: list[str], workplace: Path, longest_s: float = LONGEST_S) -> int:
    """Run pytest on a copy of the checkout and return its exit code; -1 where it takes longer than it may."""
    environment = {**os.environ, "PYTHONPATH": str(workplace), "NUMBA_CACHE_DIR": str(workplace / "compiled")}
    tests = subprocess.Popen(
        [sys.executable, "-m", "pytest", "-q", *options],
        cwd=workplace,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return tests.wait(longest_s)
    except subprocess.TimeoutExpired:
        return -1
    finally:
        if tests.poll() is None:
            os.killpg(tests.pid, signal.SIGKILL)
            tests.wait()


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=300)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--nightly", action="store_true")
    options.add_argument("--core", action="store_true")
    options.add_argument("--near", action="store_true")
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    if not chosen.out.exists():
        chosen.out.write_text(",".join(FIELDS) + "\n")
    with chosen.out.open(newline="") as file:
        known = {(row["file"], row["line"], row["what"]) for row in csv.DictReader(file)}
    tiers = list(TIERS) if chosen.nightly else list(TIERS)[:2]
    mutants = sampled(chosen.count, chosen.seed, core=chosen.core)
    mutants = [one for one in mutants if (one.file, str(one.line), one.what) not in known]
    writing = Lock()
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(chosen.workers) as workers:
        free = []
        for number in range(chosen.workers):
            free.append(Path(temporary) / str(number))
            shutil.copytree(ROOT, free[-1], ignore=shutil.ignore_patterns(".venv", "_build", "__pycache__", ".*_cache"))
        tests = {mutant: near(mutant) for mutant in mutants} if chosen.near else shown(mutants, chosen.out, free[0])

        def run(mutant: Mutant) -> None:
            workplace = free.pop()
            began = time.monotonic()
            by = killed_by(mutant, tests[mutant], tiers, workplace)
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
