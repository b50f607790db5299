"""Command lines of this checkout against those of another: exit codes, both outputs, and hashes of the files that are written.

    python -m benchmarks.commands CHECKOUT [--only WORD] [--show]

CHECKOUT is a folder with the other commit, as `git worktree add FOLDER COMMIT` makes it. Each line runs in an empty folder
with a copy `f` of `fixtures/`. Times of day, durations and the program's own version are not compared. Prints one line for
each line that differs, and with `--show` both outputs. Exit code 1 with differences, 0 without.
"""

from __future__ import annotations

import argparse
import difflib
import hashlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parent.parent
SMALL, MODEL, MACHINE = "f/sessions/small", "f/models/small.yaml", "f/machines/reference.yaml"
PLAN = "f/sessions/small/plan.yaml"
TABLE = "f/tables/axis.csv --measured measured_mm --simulated simulated_mm"
PENDULUM = "f/simulators/pendulum.csv --simulator f/simulators/pendulum.yaml --most-runs 60 --no-held-out"
LINES = f"""
calibrate {SMALL}
calibrate {SMALL} --out m.yaml --figure c.svg --json
calibrate {SMALL} --sources gravity,strut-reference-length --tests a,b --exclude b
calibrate {SMALL} --method nothing
calibrate {SMALL} --out f/models/small.yaml
calibrate f/sessions/under-spindle --method conv-a --json
calibrate f/nowhere
calibrate {SMALL} --source-files f/sources/scale_bow.py
circles {SMALL}
circles {SMALL} --filter 50 --table c.csv --budget
circles {SMALL} --findings --model {MODEL} --json
circles {SMALL} --model {MODEL}
circles {SMALL} --filter 77
circles {SMALL} --tests nothing
circles {SMALL} --tests a --quick-look
program --plan {PLAN} --machine {MACHINE} --out p
program --plan {PLAN} --machine {MACHINE} --model {MODEL} --out p --tests a --json
program --plan {PLAN} --machine {MACHINE} --out p --step-deg 7
program --machine {MACHINE} --out p
mismatch {TABLE} --no-held-out --table t.csv --figure t.svg
mismatch {TABLE} --no-held-out --variables load_n,oil_temp_c --json
mismatch {TABLE} --known mass=-1
mismatch {TABLE} --most-runs 5
mismatch f/tables/axis.csv
mismatch {PENDULUM} --out missing.py --table rows.csv --figure s.svg
mismatch {PENDULUM} --measured x
diagnose {SMALL} --no-held-out
diagnose {SMALL} --no-held-out --out d.yaml --figure d.svg --json
diagnose {SMALL} --sources nothing
compare {SMALL} f/sessions/virtual
compare {SMALL} {SMALL} --no-held-out --json
identify f/drives/strut.csv
identify f/drives/strut.csv --table d.csv --json
evaluate {SMALL} --model {MODEL}
evaluate {SMALL} --model {MODEL} --json
report {SMALL} --page r.html
report {SMALL} --model {MODEL} --page r.html --json
predict --model {MODEL} f/nowhere.csv
simulate --model {MODEL} {PLAN} --out s --tests a
export {SMALL} --out e.csv
history f/sessions --table h.csv --json
circles {SMALL} --tests a --figure p.svg
check {SMALL} {MODEL} {PLAN}
sources gravity
sources --json
fleet {SMALL} --task circles --json
""".strip().splitlines()
HELD = (
    "calibrate",
    "circles",
    "program",
    "mismatch",
    "diagnose",
    "compare",
    "identify",
    "evaluate",
    "report",
    "predict",
)
LINES += [f"{name} --help" for name in (*HELD, "simulate", "compensate", "export", "history", "fleet")]
OLD_WORDS: dict[str, str] = {}
"""Words of a line that the other checkout spells otherwise."""
PASSING = re.compile(
    r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\.\d+)?(Z|[+-]\d\d:\d\d)?|\d{4}-\d\d-\d\d|[0-9.]+ (s|ms|seconds|minutes)\b"
    r"|about \d+ fit|of \d+ simulations|_[0-9a-f]{6,}|[0-9a-f]{40,}|0\.1\.0[+.\w]*"
)
"""What differs from one run to the next."""


class Outcome(NamedTuple):
    """What a line did."""

    code: int
    out: str
    err: str
    files: dict[str, str]


def outcome(checkout: Path, line: str) -> Outcome:
    """Run a line of the program in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / "fixtures", Path(folder) / "f")
        ran = subprocess.run(  # noqa: S603 - the program itself, on files of ours
            [sys.executable, "-m", "dbbstation", *shlex.split(line)],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(checkout), "PYTHONSAFEPATH": "1", "COLUMNS": "110"},
            capture_output=True,
            text=True,
            check=False,
        )
        below = sorted(path.relative_to(folder) for path in Path(folder).rglob("*") if path.is_file())
        files = {path.as_posix(): _hash(folder / path) for path in below if path.parts[0] != "f"}
        return Outcome(ran.returncode, PASSING.sub("~", ran.stdout), PASSING.sub("~", ran.stderr), files)


def _hash(path: Path) -> str:
    text = path.read_bytes().decode("utf-8", errors="replace")
    return hashlib.sha256(PASSING.sub("~", text).encode()).hexdigest()[:12]


def differences(old: Outcome, new: Outcome) -> Iterator[str]:
    """Name what differs, with the first lines that do."""
    if old.code != new.code:
        yield f"code {old.code} -> {new.code}"
    for name in ("out", "err"):
        before, after = getattr(old, name).splitlines(), getattr(new, name).splitlines()
        found = [
            text for text in difflib.unified_diff(before, after, n=0, lineterm="") if text[:2] not in {"--", "++", "@@"}
        ]
        if found:
            yield f"{name}: {len(found)} lines\n    " + "\n    ".join(text[:160] for text in found[:40])
    for file in sorted({*old.files, *new.files}):
        if old.files.get(file) != new.files.get(file):
            yield f"file {file}: {old.files.get(file)} -> {new.files.get(file)}"


def main() -> None:
    """Read the command line, run both checkouts, print what differs."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.commands", description=__doc__.splitlines()[0])
    parser.add_argument("checkout", type=Path, help="folder with the other commit")
    parser.add_argument("--only", default="", help="lines that begin with this")
    parser.add_argument("--show", action="store_true", help="print the lines of both outputs that differ")
    given = parser.parse_args()
    chosen, alike = [line for line in LINES if line.startswith(given.only)], 0
    for line in chosen:
        said = " ".join(OLD_WORDS.get(word, word) for word in line.split())
        found = list(differences(outcome(given.checkout.resolve(), said), outcome(ROOT, line)))
        alike += not found
        if found:
            told = found if given.show else [text.split("\n")[0] for text in found]
            sys.stdout.write(f"{line}\n" + "".join(f"  {text}\n" for text in told))
            sys.stdout.flush()
    sys.stdout.write(f"{alike} of {len(chosen)} lines are alike\n")
    sys.exit(alike < len(chosen))


if __name__ == "__main__":
    main()
