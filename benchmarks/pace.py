"""Processor time and memory of this checkout against any other: twelve commands, starting, the demo, and on request the tests.

    python -m benchmarks.pace COMMIT [--other FOLDER] [--rounds 3] [--only WORD] [--demo] [--tests] [--out FILE] [--json]

Both work on one session, thirty circles of [CAL Table II] at 50 Hz that the simulated machine of the tests makes, and its model.
They take turns, command by command, so that other work on the machine hits both. A figure is the least processor time of all
rounds, children included; the first round compiles. COMMIT is checked out into a temporary folder, or is one in `--other`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from benchmarks.measuring import ROOT, Row, show  # isort: skip - sets up the environment

SEED = 8
RATE_HZ = 50.0

COMMANDS: dict[str, tuple[str, ...]] = {
    "start": ("--help",),
    "check": ("check", "{session}"),
    "session list": ("session", "list", "{session}"),
    "calibrate": ("calibrate", "{session}", "--out", "{out}/model.yaml"),
    "evaluate": ("evaluate", "{session}", "--model", "{model}"),
    "circles": ("circles", "{session}", "--findings"),
    "report": ("report", "{session}", "--model", "{model}", "--page", "{out}/report.html"),
    "program": ("program", "--plan", "{plan}", "--machine", "{machine}", "--out", "{out}/programs"),
    "program --model": (
        *("program", "--plan", "{plan}", "--machine", "{machine}", "--model", "{model}"),
        *("--out", "{out}/compensated"),
    ),
    "simulate": ("simulate", "--model", "{model}", "{plan}", "--out", "{out}/simulated"),
    "compensate": ("compensate", "{part}", "--model", "{model}", "--out", "{out}/part.ngc"),
    "predict": ("predict", "--model", "{model}", "{poses}", "--table", "{out}/actual.csv"),
    "diagnose": ("diagnose", "{session}", "--out", "{out}/joint.yaml"),
}
"""What is run, by its name; `start` is no command."""

DEMO = ("demo", "--out", "{out}/demo")
TESTS = ("-m", "pytest", "-q", "-p", "no:cacheprovider")

_REPORT: dict[str, tuple[str, ...]] = {
    "report": ("report", "{session}", "--model", "{model}", "--out", "{out}/report.html")
}
_OPTIONS: dict[str, tuple[str, ...]] = {
    "simulate": ("simulate", "--model", "{model}", "--plan", "{plan}", "--out", "{out}/simulated"),
    "predict": ("predict", "--model", "{model}", "--poses", "{poses}", "--out", "{out}/actual.csv"),
}
SAID_OTHERWISE: dict[str, dict[str, tuple[str, ...]]] = {"e461050": _REPORT | _OPTIONS, "f2b049e3": _REPORT}
"""By the beginning of a commit: command lines that have other words there."""

PART = "G21 G90 G94\nG0 X-60 Y-40 Z-1000 A5 B-4 C0\nG1 X60 F600\nG1 Y40\nG2 X-60 Y40 I-60 J0\nG1 Y-40\nM2\n"
POSES = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n" + "".join(f"{k - 50},{k % 7},-1000,0,{k % 5},0\n" for k in range(100))


def ran(checkout: Path, words: tuple[str, ...], places: dict[str, str], *, module: bool = True) -> tuple[float, float]:
    """Run a command of a checkout: processor time [s] and peak memory [MB], of its children too.

    Raises:
        SystemExit: it failed.
    """
    with tempfile.TemporaryDirectory() as out, tempfile.TemporaryFile() as said:
        line = [word.format(out=out, **places) for word in words]
        environment = {
            **{name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"},
            "PYTHONPATH": str(checkout),
            "XDG_CACHE_HOME": f"{out}/cache",
            "DBBSTATION_LOG": "off",
        }
        command = [sys.executable, *(("-m", "dbbstation") if module else ()), *line]
        child = subprocess.Popen(command, cwd=checkout, env=environment, stdout=subprocess.DEVNULL, stderr=said)  # noqa: S603 - the program
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            said.seek(0)
            raise SystemExit(f"{checkout.name}: {' '.join(line)}\n{said.read().decode(errors='replace')[-2000:]}")
        return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0


def prepared(folder: Path) -> dict[str, str]:
    """Make the files that all commands work on, by this checkout."""
    from tests.plant.plan import table_ii_plan  # noqa: PLC0415 - whoever asks for help does not wait for it
    from tests.plant.session import record  # noqa: PLC0415

    session, model = folder / "session", folder / "model.yaml"
    record(session, seed=SEED, plan=table_ii_plan(SEED), rate_hz=RATE_HZ)
    (folder / "part.ngc").write_text(PART, encoding="utf-8")
    (folder / "poses.csv").write_text(POSES, encoding="utf-8")
    return {
        "session": str(session),
        "model": str(model),
        "plan": str(session / "plan.yaml"),
        "machine": str(session / "machine.yaml"),
        "part": str(folder / "part.ngc"),
        "poses": str(folder / "poses.csv"),
    }


def compared(
    checkouts: tuple[Path, Path], commit: str, places: dict[str, str], asked: argparse.Namespace
) -> dict[str, list[tuple[float, float]]]:
    """Least processor time [s] and peak memory [MB] of each command, here and there."""
    otherwise = next((lines for begin, lines in SAID_OTHERWISE.items() if commit.startswith(begin)), {})
    lines = {name: (words, True) for name, words in COMMANDS.items()}
    lines |= {"demo": (DEMO, True)} if asked.demo else {}
    lines |= {"tests": (TESTS, False)} if asked.tests else {}
    wanted = {name: line for name, line in lines.items() if re.search(asked.only, name)}
    # Each has a model of its own: their format grew.
    models = [{**places, "model": f"{places['model']}-{k}"} for k in range(len(checkouts))]
    for checkout, own in zip(checkouts, models, strict=True):
        ran(checkout, ("calibrate", "{session}", "--out", "{model}"), own)
    found: dict[str, list[tuple[float, float]]] = {}
    for number in range(asked.rounds):
        for name, (words, module) in wanted.items():
            if name in {"demo", "tests"} and number:
                continue
            for k, checkout in enumerate(checkouts):
                used = ran(checkout, otherwise.get(name, words) if k else words, models[k], module=module)
                known = found.setdefault(name, [])
                known[k:] = [used if len(known) <= k else min(known[k], used), *known[k + 1 :]]
                print(f"{number + 1} {name} {('here', 'there')[k]}: {used[0]:.2f} s, {used[1]:.0f} MB", file=sys.stderr)
    return found


def main() -> None:
    """Measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit", help="what this checkout is held against")
    parser.add_argument("--other", type=Path, help="folder in which that commit is checked out already")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", default="", help="expression that names of commands must match")
    parser.add_argument("--demo", action="store_true", help="the demo, too, once")
    parser.add_argument("--tests", action="store_true", help="the tests, too, once")
    parser.add_argument("--out", type=Path, help="keep the figures here, as JSON")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        other = asked.other or folder / "other"
        if asked.other is None:
            git("worktree", "add", "--detach", str(other), asked.commit)
        try:
            places = prepared(folder)
            found = compared((ROOT, other), git("rev-parse", asked.commit), places, asked)
        finally:
            if asked.other is None:
                git("worktree", "remove", "--force", str(other))
    if asked.out is not None:
        keep(asked.out, asked.commit, found)
    rows = []
    for name, (here, there) in found.items():
        rows.append(Row(name, here[0] / there[0], "times", f"{here[0]:.2f} s over {there[0]:.2f} s"))
        rows.append(Row("  memory", here[1] / there[1], "times", f"{here[1]:.0f} MB over {there[1]:.0f} MB"))
    show(f"pace against {asked.commit}", rows, f"processor time, least of {asked.rounds} rounds that take turns")


def keep(file: Path, commit: str, found: dict[str, list[tuple[float, float]]]) -> None:
    """Write figures beside those against other commits that are in the file."""
    former = json.loads(file.read_text("utf-8")) if file.exists() else {}
    columns = [*former.get("columns", []), commit]
    figures = former.get("figures", {})
    for name, (here, there) in found.items():
        row = figures.setdefault(name, ["-"] * (len(columns) - 1))
        row.append(f"{here[0] / there[0]:.2f} ({here[0]:.2f} s), memory {here[1] / there[1]:.2f}")
    whole = {
        "question": "How fast is the program beside former commits?",
        "data": "30 circles at 50 Hz; processor time over that of the commit, in brackets by itself; peak memory over that of the commit.",
        "command": "python -m benchmarks.pace COMMIT",
        "commit": git("rev-parse", "--short", "HEAD"),
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "seed": SEED,
        "load": f"{os.getloadavg()[0]:.1f}",
        "limits": "Other work on the two cores makes processor time longer, on both sides alike; a single figure moves by a tenth.",
        "columns": columns,
        "figures": {name: [*row, *["-"] * (len(columns) - len(row))] for name, row in figures.items()},
    }
    file.write_text(json.dumps(whole, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def git(*words: str) -> str:
    """Ask git of this checkout."""
    done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=True)  # noqa: S603, S607
    return done.stdout.strip()


if __name__ == "__main__":
    main()
