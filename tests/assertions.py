"""What tests assert, as a list: sentences, exit codes, figures; and what a change to the tests has lost.

    python -m tests.assertions COMMIT [--out tests/stored/assertions.json]

Reads the tests of a commit and those of this checkout. An assertion is an `assert`, an expected exception or a call of
`numpy.testing`, as it is written; a case is a row of `parametrize`. What the commit had in a tier and this checkout has in that tier
no more is printed with its test. For a lost sentence, tests that still hold each of its texts are named beside it.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import re
import subprocess
import tarfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
CODES = frozenset({"code", "returncode", "exit_code", "DONE", "FAILED", "USAGE"})
EXPECTING = ("pytest.raises", "pytest.warns", "np.testing.", "numpy.testing.")


@dataclass(frozen=True)
class Assertion:
    """One line that a test asserts, with the file and function it stands in."""

    test: str
    tier: str
    kind: str
    text: str
    sentences: tuple[str, ...]

    @property
    def line(self) -> tuple[str, str]:
        return self.tier, self.text


def of_checkout() -> dict[str, str]:
    return {str(path.relative_to(ROOT)): path.read_text() for path in sorted((ROOT / "tests").rglob("*.py"))}


def of_commit(commit: str) -> dict[str, str]:
    packed = subprocess.run(["git", "archive", commit, "tests"], cwd=ROOT, capture_output=True, check=True).stdout  # noqa: S607
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        return {
            member.name: archive.extractfile(member).read().decode()  # type: ignore[union-attr]
            for member in archive.getmembers()
            if member.name.endswith(".py")
        }


def assertions(files: dict[str, str]) -> list[Assertion]:
    return [one for path, text in files.items() for one in _of_file(path, ast.parse(text))]


def _of_file(path: str, tree: ast.Module) -> Iterator[Assertion]:
    of_file = "\n".join(map(ast.unparse, (node for node in tree.body if isinstance(node, ast.Assign))))
    of_file = of_file if "pytestmark" in of_file else ""
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        marks = of_file + "".join(
            text for text in map(ast.unparse, function.decorator_list) if "parametrize" not in text
        )
        for node in [*_cases(function), *_asserted(function)]:
            text = ast.unparse(node)
            texts = tuple(
                part.value
                for part in ast.walk(node)
                if isinstance(part, ast.Constant) and isinstance(part.value, str) and " " in part.value.strip()
            )
            yield Assertion(
                f"{path}::{function.name}",
                _tier(marks + text),
                _kind(node, texts),
                ast.unparse(node),
                texts,
            )


def _tier(text: str) -> str:
    marks = re.findall(r"mark\.(nightly|slow)\b", text)
    return min(marks, default="default")


def _cases(function: ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[ast.expr]:
    for decorator in function.decorator_list:
        if isinstance(decorator, ast.Call) and ast.unparse(decorator.func).endswith("parametrize"):
            yield from getattr(decorator.args[1], "elts", [decorator.args[1]])


def _asserted(function: ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[ast.expr]:
    waiting: list[ast.AST] = list(function.body)
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, ast.Assert):
            yield node.test
        elif isinstance(node, ast.Call) and ast.unparse(node.func).startswith(EXPECTING):
            yield node
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            waiting += ast.iter_child_nodes(node)


def _kind(node: ast.expr, texts: tuple[str, ...]) -> str:
    names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
    names |= {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}
    if names & CODES:
        return "exit code"
    if texts:
        return "sentence"
    numbers = (
        part for part in ast.walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, int | float)
    )
    return "figure" if any(True for _ in numbers) else "other"


def lost(before: list[Assertion], now: list[Assertion]) -> list[dict[str, object]]:
    """Assertions that a tier has less often than before, with the tests that still hold their texts."""
    left = Counter(one.line for one in now)
    holding = defaultdict(set)
    for one in now:
        for sentence in one.sentences:
            holding[sentence].add(one.test)
    gone = []
    for one in before:
        if left[one.line] > 0:
            left[one.line] -= 1
            continue
        still = sorted(set.intersection(*(holding[sentence] for sentence in one.sentences))) if one.sentences else []
        gone.append({"test": one.test, "tier": one.tier, "kind": one.kind, "assertion": one.text, "still_in": still})
    return gone


def counted(every: list[Assertion]) -> dict[str, dict[str, int]]:
    counts: dict[str, dict[str, int]] = defaultdict(dict)
    for (tier, kind), count in sorted(Counter((one.tier, one.kind) for one in every).items()):
        counts[tier][kind] = count
    return counts


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("commit")
    options.add_argument("--out", type=Path)
    chosen = options.parse_args()
    before, now = assertions(of_commit(chosen.commit)), assertions(of_checkout())
    result = {
        "question": "which assertions of the tests of a commit does this checkout lack in the same tier?",
        "command": f"python -m tests.assertions {chosen.commit}",
        "before": counted(before),
        "now": counted(now),
        "lost": lost(before, now),
    }
    text = json.dumps(result, indent=1, ensure_ascii=False) + "\n"
    if chosen.out:
        chosen.out.write_text(text, encoding="utf-8")
    else:
        print(text, end="")  # noqa: T201


if __name__ == "__main__":
    main()
