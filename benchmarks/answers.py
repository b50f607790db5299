"""Answers of this checkout against those of another commit: every verdict, value and figure of `--json` on all fixtures.

    python benchmarks/answers.py COMMIT [--only WORD] [--relative 1e-6] [--keep FOLDER] [--json]

Runs both checkouts on the same files: `fixtures/`, and recordings, drives and tables in the folder that
`DBBSTATION_RECORDINGS` names. What a commit said is kept in `--keep` and not asked again; what a checkout with changes said
is kept under these changes. Prints each difference: case, key path, old, new. Numbers are alike within `--relative` of the
larger one; a list of objects is matched by their names. Exit code 1 with differences, 0 without.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

ROOT = Path(__file__).resolve().parent.parent
LINES: dict[str, tuple[str, ...]] = {
    "check": ("check", "{}", "--json"),
    "circles": ("circles", "{}", "--json"),
    "calibrate": ("calibrate", "{}", "--json"),
    "diagnose": ("diagnose", "{}", "--json"),
    "drive": ("identify", "{}", "--json"),
    "history": ("history", "{}", "--json"),
}
"""Command lines of tasks that need nothing but a path."""
SAID_OTHERWISE: dict[str, dict[str, str]] = {}
"""By the beginning of a commit: words of its command line that have another name there; an empty one is left out."""
IDENTITY = ("name", "test", "direction", "repeat", "strut", "parameter", "cause", "source", "file", "variable")
"""What tells the objects of a list apart, where it does."""
OF_THE_RUN = frozenset({"provenance", "program", "seconds", "processor_s", "memory_mb", "date"})
"""Keys that say when and by what something was computed."""
MISSING = "-"
INTERRUPTED = "interrupted"
"""What the program says when somebody stops it, with exit code 1: that is no answer and is not kept."""


def cases(root: Path, recordings: Path | None) -> dict[str, tuple[str, ...]]:
    """Command lines by name."""
    found: dict[str, tuple[str, ...]] = {
        "sources": ("sources", "--json"),
        "instruments": ("instrument", "list", "--json"),
        "evaluate small": ("evaluate", "fixtures/sessions/small", "--model", "fixtures/models/small.yaml", "--json"),
        "compare small": ("compare", "fixtures/sessions/small", "fixtures/sessions/virtual", "--json"),
        "mismatch pendulum": (
            *("mismatch", "fixtures/simulators/pendulum.csv", "--simulator", "fixtures/simulators/pendulum.yaml"),
            *("--no-held-out", "--json"),
        ),
    }
    folders = [root / "fixtures", *([] if recordings is None else [recordings])]
    sessions = [path.parent for folder in folders for path in sorted(folder.rglob("session.yaml"))]
    drives = [path for folder in folders for path in sorted(folder.rglob("*.csv")) if _is_drive(path)]
    for path in sessions:
        tasks = ("check", "circles", "calibrate", "diagnose")
        found |= {f"{task} {path.name}": _line(task, path, root) for task in tasks}
    found |= {f"drive {path.stem}": _line("drive", path, root) for path in drives}
    found["history"] = _line("history", root / "fixtures" / "sessions", root)
    for path in (path for folder in folders for path in sorted(folder.rglob("*.csv"))):
        measured, simulated = _compared(path)
        if measured and simulated:
            words = ("mismatch", _said(path, root), "--measured", measured, "--simulated", simulated, "--json")
            found[f"mismatch {path.stem}"] = words
    return found


def differences(old: object, new: object, relative: float, path: str = "") -> Iterator[tuple[str, object, object]]:
    """Key path, old and new of whatever is not alike in two answers."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in dict.fromkeys([*old, *new]):
            if key not in OF_THE_RUN:
                at = f"{path}.{key}" if path else str(key)
                yield from differences(old.get(key, MISSING), new.get(key, MISSING), relative, at)
    elif isinstance(old, list) and isinstance(new, list):
        by_name, others = _by_name(old), _by_name(new)
        for key in dict.fromkeys([*by_name, *others]):
            yield from differences(by_name.get(key, MISSING), others.get(key, MISSING), relative, f"{path}[{key}]")
    elif not _alike(old, new, relative):
        yield path, old, new


def _alike(old: object, new: object, relative: float) -> bool:
    if isinstance(old, int | float) and isinstance(new, int | float) and bool not in {type(old), type(new)}:
        return old == new or abs(old - new) <= relative * max(abs(old), abs(new))
    return old == new


def _by_name(items: list[Any]) -> dict[str, Any]:
    """Items of a list by what they are called; by their place where that does not tell them apart."""
    names = [
        " ".join(str(item[key]) for key in IDENTITY if key in item and not isinstance(item[key], dict | list))
        if isinstance(item, dict)
        else ""
        for item in items
    ]
    if len(set(names)) < len(items) or not all(names):
        names = [str(place) for place in range(len(items))]
    return dict(zip(names, items, strict=True))


def answer(checkout: Path, commit: str, words: tuple[str, ...], kept: Path) -> dict[str, object]:
    """What a checkout prints, as JSON where it is that, with its exit code."""
    if kept.exists():
        return dict(json.loads(kept.read_text(encoding="utf-8")))
    names = next((of for begin, of in SAID_OTHERWISE.items() if commit.startswith(begin)), {})
    translated = [word for word in (names.get(word, word) for word in words) if word]
    ran = subprocess.run(  # noqa: S603 - the program itself, on files of ours
        [sys.executable, "-m", "dbbstation", *translated],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(checkout), "PYTHONSAFEPATH": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    if ran.returncode < 0 or (not ran.stdout and ran.stderr.startswith(INTERRUPTED)):
        sys.exit(f"{' '.join(translated)} was interrupted ({ran.returncode}); run the same command to go on")
    try:
        said = json.loads(ran.stdout)
    except ValueError:
        said = (ran.stdout or ran.stderr).splitlines()
    told = {"exit_code": ran.returncode, "said": said}
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.with_suffix(".part").write_text(json.dumps(told), encoding="utf-8")
    kept.with_suffix(".part").replace(kept)
    return told


def main() -> None:
    """Read the command line, ask both checkouts, print what differs."""
    parser = argparse.ArgumentParser(prog="python benchmarks/answers.py", description=__doc__.splitlines()[0])
    parser.add_argument("commit", help="to hold this checkout against")
    parser.add_argument("--only", default="", help="cases whose name has this in it, as in diagnose or small")
    parser.add_argument("--relative", type=float, default=1e-6, help="by how much numbers may differ [default: 1e-6]")
    parser.add_argument(
        "--keep", type=Path, default=ROOT / ".answers", help="folder for answers and the other checkout"
    )
    parser.add_argument("--json", action="store_true", help="print the differences as JSON")
    given = parser.parse_args()
    old_commit = _git("rev-parse", "--short=8", given.commit)
    keep = given.keep.resolve()
    old_checkout = keep / "checkouts" / old_commit
    if not old_checkout.exists():
        _git("worktree", "add", "--detach", str(old_checkout), old_commit)
    new_commit = _this_state()
    recordings = os.environ.get("DBBSTATION_RECORDINGS")
    table: dict[str, list[tuple[str, object, object]]] = {}
    for name, words in cases(ROOT, Path(recordings) if recordings else None).items():
        if given.only in name:
            file = f"{name.replace(' ', '-')}.json"
            old, new = (
                answer(checkout, commit, words, keep / commit / file)
                for checkout, commit in ((old_checkout, old_commit), (ROOT, new_commit))
            )
            table[name] = list(differences(old, new, given.relative))
            sys.stderr.write(f"{name}: {len(table[name])} differences\n")
    if given.json:
        head = {"old": old_commit, "new": new_commit, "relative": given.relative}
        sys.stdout.write(json.dumps({**head, "differences": table}, indent=1, ensure_ascii=False) + "\n")
    else:
        sys.stdout.writelines(f"{line}\n" for line in _lines(table))
    sys.exit(1 if any(table.values()) else 0)


def _lines(table: Mapping[str, list[tuple[str, object, object]]]) -> Iterator[str]:
    for name, found in table.items():
        yield from (f"{name}: {path}: {_short(old)} -> {_short(new)}" for path, old, new in found)
    yield f"{sum(map(len, table.values()))} differences in {sum(map(bool, table.values()))} of {len(table)} cases"


def _short(value: object) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 100 else f"{text[:97]}..."  # noqa: PLR2004 - what fits beside another on a line


def _this_state() -> str:
    """The commit of this checkout, with a mark of what is changed in the program since."""
    changed = _git("diff", "HEAD", "--", "dbbstation")
    mark = f"-{hashlib.sha256(changed.encode()).hexdigest()[:8]}" if changed else ""
    return _git("rev-parse", "--short=8", "HEAD") + mark


def _git(*words: str) -> str:
    line = ["git", "-C", str(ROOT), *words]
    ran = subprocess.run(line, check=False, capture_output=True, text=True)  # noqa: S603 - words of this script
    if ran.returncode:
        sys.exit(f"git {' '.join(words)}: {ran.stderr.strip()}")
    return ran.stdout.strip()


def _line(task: str, path: Path, root: Path) -> tuple[str, ...]:
    return tuple(word.format(_said(path, root)) for word in LINES[task])


def _said(path: Path, root: Path) -> str:
    """Fixtures by their path in the checkout, so that both say the same."""
    return str(path.relative_to(root)) if path.is_relative_to(root) else str(path)


def _header(path: Path) -> list[str]:
    with path.open(encoding="utf-8", errors="replace", newline="") as file:
        return next(csv.reader(line for line in file if not line.startswith("#")), [])


def _is_drive(path: Path) -> bool:
    return {"t_s", "position_mm"} < set(_header(path))


def _compared(path: Path) -> tuple[str, str]:
    """Columns of a table that are to be held against each other; empty where it has none."""
    header = _header(path)
    measured, simulated = (
        next((name for name in header if name.startswith(begins)), "")
        for begins in (("measured", "meas_"), ("simulated", "sim_", "model"))
    )
    return measured, simulated


if __name__ == "__main__":
    main()
