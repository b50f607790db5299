"""Runs `diagnose` of any checkout on a session, and keeps what it said with its processor time and memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

COMMAND = {"": ("diagnose", "{session}", "--json")}
"""Words of the command by the beginning of a commit; those under "" are for all commits that say nothing else."""
KIB_PER_MB = 1024.0
INTERRUPTED = "interrupted"
"""What the program says when somebody stops it, with exit code 1: that says nothing of the session, and is not kept."""


TRUE = "-true"
"""What follows a commit in the name of the folder of verdicts on the causes that were put in, and no others."""


def commit_of(checkout: Path) -> str:
    asked = ["git", "-C", str(checkout), "rev-parse", "--short=8", "HEAD"]
    return subprocess.run(asked, check=True, capture_output=True, text=True).stdout.strip()


def causes_of(folder: Path, session: str) -> list[str]:
    """Return the listed causes that were put into a session."""
    answer = json.loads((folder / "answers" / f"{session}.json").read_text(encoding="utf-8"))
    return [effect["name"] for effect in answer["effects"] if effect["listed"]]


def judge(
    folder: Path, checkout: Path, commit: str, session: str, causes: Sequence[str] | None = None
) -> dict[str, Any]:
    """Return what a checkout says of a session, of all causes or of these."""
    kept = folder / "verdicts" / (commit if causes is None else f"{commit}{TRUE}") / f"{session}.json"
    if kept.exists():
        return dict(json.loads(kept.read_text(encoding="utf-8")))
    words = next(COMMAND[begin] for begin in sorted(COMMAND, reverse=True) if commit.startswith(begin))
    words = words if causes is None else (*words, "--sources", ",".join(causes))
    path = (folder / session).resolve()
    with tempfile.TemporaryFile() as said, tempfile.TemporaryFile() as complained:
        child = subprocess.Popen(
            [sys.executable, "-m", "dbbstation", *(word.format(session=path) for word in words)],
            cwd=checkout,
            env={**os.environ, "PYTHONPATH": str(checkout)},
            stdout=said,
            stderr=complained,
        )
        # The only way to the time and memory of this child alone, with all that it started and waited for.
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        complained.seek(0)
        text, error = said.read().decode(), complained.read().decode()
    if child.returncode < 0 or (not text.strip() and error.startswith(INTERRUPTED)):
        sys.exit(f"{session}: diagnose was interrupted ({child.returncode}); run the same command to go on")
    summary = json.loads(text) if text.strip() else {}
    if any(limit["what"] == "stopped" for limit in summary.get("limits", ())):
        sys.exit(f"{session}: somebody stopped the comparison; run the same command to go on")
    verdict = {
        "session": session,
        "commit": commit,
        "processor_s": used.ru_utime + used.ru_stime,
        "memory_mb": used.ru_maxrss / KIB_PER_MB,
        "exit_code": child.returncode,
        **({"summary": summary} if summary else {"error": error[-2000:]}),
    }
    kept.parent.mkdir(parents=True, exist_ok=True)
    part = kept.with_suffix(".part")
    part.write_text(json.dumps(verdict), encoding="utf-8")
    part.replace(kept)
    return verdict
