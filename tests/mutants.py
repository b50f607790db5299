"""What tests detect: sampled mutants of the core, each shown to the tests that run its place.

    python -m tests.mutants --count 150 --seed 5 --out mutants.csv

A mutant is a copy of the package in which one operator, comparison, number, condition or returned value is another
[DeMillo, Lipton and Sayward, Computer 11 (1978) 34]. It is killed where a test fails. Every part of the core gives as many.

Which tests run a place is noted once, in one run of the default tests into a file beside the table (mutants.notes), by calls
put there. Names of a module's constants are noted where functions of the module read them. Tests of the place's folder come
first, then the fastest. Where no call can stand (compiled kernels, defaults of arguments), and behind the tests that were
seen, come the test files that name the module.

Kernels have to be compiled (`python -m dbbstation.prepare`) and the machine idle: durations that compiling or other programs lengthen
leave few tests. The one run of all default tests takes two processes.

The table goes on where it was interrupted. Two columns are filled by hand: `equivalent`, why a
survivor changes nothing that counts, and `since`, a later test that kills it, which `--since` tries. At the end all tests that
killed run once more without a mutant, and have to pass.
"""

from __future__ import annotations

import argparse
import ast
import copy
import csv
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.ran import LONGEST_S, NOTES, PLAN

ROOT = Path(__file__).parents[1]
PACKAGE = "dbbstation"

NOTED = "not slow and not nightly"
LEFT_OUT = ("tests/fuzz", "tests/tui", "tests/docs", "tests/text", "tests/test_releasing.py")
"""Tests that check no number of the core, or run its programs as others do."""

MOST_TESTS = 40
MOST_S = 60.0
"""What a mutant is shown to at most, in noted durations: a bound on the cost, so that more may die than are said to."""

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

FIELDS = ("part", "file", "line", "what", "killed_by", "tests", "seconds", "since", "equivalent")


@dataclass(frozen=True)
class Mutant:
    """One change: part and file below the package, place in the order of the file's changeable nodes, line, and what it does."""

    part: str
    file: str
    place: int
    line: int
    what: str

    @property
    def key(self) -> tuple[str, str, str]:
        return self.file, str(self.line), self.what


@dataclass
class Notes:
    """What was noted: tests of each place, by number; seconds of each test that passed, and of each file's set-up; what killed a mutant,
    and number of tests and seconds of those that were shown."""

    tests: dict[int, set[str]] = field(default_factory=lambda: defaultdict(set))
    seconds: dict[str, float] = field(default_factory=dict)
    set_up: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    killed: dict[int, str] = field(default_factory=dict)
    shown: dict[int, tuple[str, str]] = field(default_factory=dict)


def places(tree: ast.Module) -> list[ast.AST]:
    """Nodes that can be changed, without annotations and docstrings, in the order of the file."""
    found: list[ast.AST] = []
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if changed(node) is not None:
            found.append(node)
        for name, value in ast.iter_fields(node):
            if name in {"annotation", "returns", "decorator_list"}:
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


def sampled(count: int, seed: int) -> list[Mutant]:
    """Draw mutants, one of each part after the other."""
    drawn = np.random.default_rng(seed)
    parts = [changeable(part, begins) for part, begins in CORE.items()]
    orders = [drawn.permutation(len(part)) for part in parts]
    return [part[order[k]] for k in range(-(-count // len(parts))) for part, order in zip(parts, orders, strict=True)][
        :count
    ]


def changeable(part: str, begins: tuple[str, ...]) -> list[Mutant]:
    every = []
    for path in sorted((ROOT / PACKAGE).rglob("*.py")):
        file = path.relative_to(ROOT / PACKAGE).as_posix()
        for place, node in enumerate(places(ast.parse(path.read_text())) if file.startswith(begins) else ()):
            other = changed(node)
            assert other is not None
            what = f"{ast.unparse(node)[:60]} -> {ast.unparse(other)[:60]}".replace("\n", " ")
            every.append(Mutant(part, file, place, getattr(node, "lineno", 0), what))
    return every


def mutated(source: str, place: int) -> str:
    """Change one place and leave every other character; where the tree cannot be met so, in f-strings, write it anew."""
    tree = ast.parse(source)
    node = places(tree)[place]
    other = changed(node)
    assert other is not None
    begin, end = _span(source, node)
    text = (
        f"{source[:begin]}{'return None' if isinstance(node, ast.Return) else f'({ast.unparse(other)})'}{source[end:]}"
    )
    whole = ast.fix_missing_locations(_Exchange(node, other).visit(tree))
    return text if _same(text, whole) else ast.unparse(whole)


def _same(text: str, tree: ast.Module) -> bool:
    try:
        return ast.dump(ast.parse(text)) == ast.dump(tree)
    except SyntaxError:
        return False


class _Exchange(ast.NodeTransformer):
    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self._old, self._new = old, new

    def visit(self, node: ast.AST) -> ast.AST:
        return self._new if node is self._old else self.generic_visit(node)


def _span(source: str, node: ast.AST) -> tuple[int, int]:
    """Begin and end of a node among the characters."""
    lines = source.splitlines(keepends=True)

    def at(line: int, column: int) -> int:
        return sum(map(len, lines[: line - 1])) + len(lines[line - 1].encode()[:column].decode(errors="ignore"))

    return at(node.lineno, node.col_offset), at(node.end_lineno, node.end_col_offset)


def with_calls(source: str, numbers: dict[int, int]) -> tuple[str, set[int]]:
    """Put a call of `ran` with its number at each place, and return the numbers whose mutants the calls put in force."""
    nodes = places(ast.parse(source))
    put, able = [], set()
    for place, number in numbers.items():
        node = nodes[place]
        reads, itself = _read_by(source, node)
        if itself:
            able.add(number)
        other = changed(node)
        for read in reads:
            text = ast.unparse(read if not itself else other.value if isinstance(other, ast.Return) else other)
            begin, end = _span(source, read)
            put += [(begin, 1, f"(({text}) if __import__('tests.ran').ran.ran({number}) else ("), (end, 0, "))")]
    for at, _, text in sorted(put, reverse=True):  # from the end, so that the places before stay where they are
        source = source[:at] + text + source[at:]
    return source, able


def _read_by(source: str, node: ast.AST) -> tuple[list[ast.AST], bool]:
    """Expressions of functions that stand for a place: itself, or the reads of the constant that it is part of; and whether itself."""
    tree = ast.parse(source)
    same = ast.dump(node, include_attributes=True)
    # In f-strings nodes have no columns, in patterns no call can stand.
    barred = {part for one in ast.walk(tree) if isinstance(one, ast.JoinedStr | ast.pattern) for part in ast.walk(one)}
    inside = [one for body in _bodies(tree) for one in ast.walk(body) if one not in barred]
    if any(ast.dump(one, include_attributes=True) == same for one in inside):
        return [node.value if isinstance(node, ast.Return) else node], True
    names = {
        target.id
        for line in tree.body
        if isinstance(line, ast.Assign | ast.AnnAssign) and line.lineno <= node.lineno <= line.end_lineno
        for target in (line.targets if isinstance(line, ast.Assign) else [line.target])
        if isinstance(target, ast.Name)
    }
    return [
        one for one in inside if isinstance(one, ast.Name) and one.id in names and isinstance(one.ctx, ast.Load)
    ], False


def _bodies(tree: ast.Module) -> list[ast.stmt]:
    """Statements of functions that Python runs."""
    functions = [one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)]
    compiled = [one for one in functions if {"compiled", "inlined"} & {ast.unparse(by) for by in one.decorator_list}]
    nested = {inner for one in functions for inner in ast.walk(one) if inner is not one}
    return [line for one in functions if one not in nested and one not in compiled for line in one.body]


def put_calls(mutants: list[Mutant], workplace: Path) -> set[int]:
    """Put a call at every place of a copy and return the numbers of mutants that a call can put in force."""
    of_files: dict[str, dict[int, int]] = defaultdict(dict)
    for number, mutant in enumerate(mutants):
        of_files[mutant.file][mutant.place] = number
    every = set()
    for file, numbers in of_files.items():
        path = workplace / PACKAGE / file
        text, able = with_calls(path.read_text(), numbers)
        path.write_text(text)
        every |= able
    return every


def read_notes(path: Path) -> Notes:
    """Tests that passed, each with its places; what ran while a fixture is made counts for all tests of the file."""
    notes, ran, failed = Notes(), [], set()
    for kind, *cells in (line.split("\t") for line in path.read_text(encoding="utf-8").splitlines()):
        if kind == "ran":
            ran.append(cells)
        elif kind == "killed":
            notes.killed.setdefault(int(cells[0]), cells[1])
        elif kind == "shown":
            notes.shown[int(cells[0])] = (cells[1], cells[2])
        elif cells[2] != "passed":
            failed.add(cells[0])
        elif cells[1] == "call":
            notes.seconds[cells[0]] = float(cells[3])
        else:
            path = cells[0].partition("::")[0]
            notes.set_up[path] = max(notes.set_up[path], float(cells[3]))
    notes.seconds = {test: took for test, took in notes.seconds.items() if test not in failed}
    of_file = defaultdict(set)
    for test in notes.seconds:
        of_file[test.partition("::")[0]].add(test)
    for number, test, *phase in ran:
        whole = phase != ["call"]
        notes.tests[int(number)] |= of_file[test.partition("::")[0]] if whole else {test} & notes.seconds.keys()
    return notes


def shown(mutant: Mutant, number: int, notes: Notes) -> list[str]:
    """Tests of a mutant: those that run its place, of its folder first, then of files that name its module; the fastest first."""
    module = ".".join((PACKAGE, *Path(mutant.file).with_suffix("").parts)).removesuffix(".__init__")
    named = re.compile(rf"{re.escape(module)}\b(?!\.)")
    files = {
        str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("test_*.py") if named.search(path.read_text())
    }
    near = {test for test in notes.seconds if test.partition("::")[0] in files}
    folder = f"tests/{mutant.file.partition('/')[0]}/"

    def rank(test: str) -> tuple[bool, bool, float]:
        alone_s = notes.seconds[test] + notes.set_up[test.partition("::")[0]]
        return test not in notes.tests[number], not test.startswith(folder), alone_s

    chosen, set_up, left_s = [], set(), MOST_S
    for test in sorted(notes.tests[number] | near, key=rank):
        path = test.partition("::")[0]
        takes_s = notes.seconds[test] + (0.0 if path in set_up else notes.set_up[path])
        if len(chosen) < MOST_TESTS and (takes_s <= left_s or not chosen):
            chosen.append(test)
            set_up.add(path)
            left_s -= takes_s
    return chosen


def killed_by(mutant: Mutant, tests: list[str], workplace: Path) -> str:
    """Return the first test that fails, "time" or "import"; "" where all pass."""
    path = workplace / PACKAGE / mutant.file
    original, stat = path.read_bytes(), path.stat()
    path.write_text(mutated(original.decode(), mutant.place))
    try:
        # Kernels of other files would keep a compiled kernel as it was.
        with tempfile.TemporaryDirectory() as compiled:
            own = (
                {"NUMBA_CACHE_DIR": compiled}
                if "@compiled" in original.decode() or "@inlined" in original.decode()
                else {}
            )
            return _first_failure(tests, workplace, own)
    finally:
        path.write_bytes(original)
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def _first_failure(tests: list[str], workplace: Path, environment: dict[str, str]) -> str:
    if not tests:
        return ""
    named = workplace / "tests.txt"
    named.write_text("\n".join(tests))
    code, said = _run_tests(["-x", "-m", NOTED, f"@{named}"], workplace, LONGEST_S, environment)
    if code == 0:
        return ""
    if code < 0:
        return "time"
    if failed := re.search(r"^(?:FAILED|ERROR) (tests/\S+?\.py(?:::.*?)?)(?: - .*)?$", said, re.MULTILINE):
        return failed[1]
    if "ImportError while loading conftest" in said:
        return "import"
    raise RuntimeError(said)


def _run_tests(options: list[str], workplace: Path, longest_s: int, environment: dict[str, str]) -> tuple[int, str]:
    """Run pytest on a copy of the checkout; return its exit code, below 0 if it takes more processor time than it may, and its output."""
    said = workplace / "said.txt"
    with said.open("w") as file:
        tests = subprocess.Popen(
            [sys.executable, "-m", "pytest", "-q", "--tb=no", "-p", "no:cacheprovider", *options],
            cwd=workplace,
            env={**os.environ, "PYTHONPATH": str(workplace), **environment},
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        resource.prlimit(tests.pid, resource.RLIMIT_CPU, (longest_s, longest_s))
        try:
            code = tests.wait(10 * longest_s)
        except subprocess.TimeoutExpired:
            code = -1
        finally:
            if tests.poll() is None:
                os.killpg(tests.pid, signal.SIGKILL)
                tests.wait()
    return code, said.read_text()


def copied(workplace: Path) -> Path:
    """Copy the checkout with its compiled kernels, which the copies of the files keep valid."""
    ignored = shutil.ignore_patterns(".venv", ".git", "_build", "*.pyc", ".*_cache")
    return Path(shutil.copytree(ROOT, workplace, ignore=ignored))


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=150)
    options.add_argument("--seed", type=int, default=5)
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--since", action="store_true")
    chosen = options.parse_args()
    mutants = sampled(chosen.count, chosen.seed)
    with tempfile.TemporaryDirectory() as temporary:
        workplace = copied(Path(temporary) / "mutants")
        if not chosen.since:
            show(mutants, chosen.out, copied(Path(temporary) / "calls"), workplace)
        rows = _rows(chosen.out)
        of_key = {mutant.key: mutant for mutant in mutants}
        for row in rows if chosen.since else []:
            if row["since"] and not killed_by(of_key[_key(row)], [row["since"]], workplace):
                print(f"{row['since']} does not kill {_key(row)}")  # noqa: T201
        killers = sorted({test for row in rows for test in (row["killed_by"], row["since"]) if "::" in test})
        if failing := _first_failure(killers, workplace, {}):
            print(f"{failing} fails without a mutant")  # noqa: T201
    for part in CORE:
        own = [row for row in rows if row["part"] == part]
        kinds = (True, "equivalent", "killed_by", "since")
        print(part, [sum(kind is True or bool(row[kind]) for row in own) for kind in kinds])  # noqa: T201


def show(mutants: list[Mutant], out: Path, with_calls: Path, workplace: Path) -> None:
    """Note the tests of all places where that was not done yet, and show each mutant that the table lacks to its own."""
    path = out.with_suffix(".notes")
    able = put_calls(mutants, with_calls)
    every = ["-p", "tests.ran", "-m", NOTED, *(f"--ignore={left}" for left in LEFT_OUT), "tests"]
    if not path.exists():
        _run_tests([*every, "-n", "2", "--max-worker-restart=0"], with_calls, 36000, {NOTES: str(path.resolve())})
    if not out.exists():
        out.write_text(",".join(FIELDS) + "\n", encoding="utf-8")
    notes = read_notes(path)
    write(mutants, notes, out)
    known = {_key(row) for row in _rows(out)}
    left = {number: shown(one, number, notes) for number, one in enumerate(mutants) if one.key not in known}
    plan = with_calls / "plan.json"
    plan.write_text(json.dumps([(number, tests) for number, tests in left.items() if number in able]))
    _run_tests(["-x", *every], with_calls, 36000, {NOTES: str(path.resolve()), PLAN: str(plan)})
    for number in left.keys() - able:
        began = time.monotonic()
        by = killed_by(mutants[number], left[number], workplace)
        with path.open("a") as file:
            file.write(f"killed\t{number}\t{by}\n" * bool(by))
            file.write(f"shown\t{number}\t{len(left[number])}\t{time.monotonic() - began:.0f}\n")
    write(mutants, read_notes(path), out)


def write(mutants: list[Mutant], notes: Notes, out: Path) -> None:
    """Put rows of mutants that were shown into the table."""
    known = {_key(row) for row in _rows(out)}
    with out.open("a", encoding="utf-8", newline="") as file:
        for number, (tests, took_s) in sorted(notes.shown.items()):
            one = mutants[number]
            if one.key not in known:
                row = [one.part, *one.key, notes.killed.get(number, ""), tests, took_s, "", ""]
                csv.writer(file, lineterminator="\n").writerow(row)


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _key(row: dict[str, str]) -> tuple[str, str, str]:
    return row["file"], row["line"], row["what"]


if __name__ == "__main__":
    main()
