"""The notebooks of the documentation run, say what is true of what they invent, and show what they print."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.notebooks import executed, printed
from tests.once import OF_SESSIONS, OF_TABLES, computed_once

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "docs").glob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebook_prints_what_it_shows(notebook, tmp_path, tmp_path_factory, monkeypatch):
    monkeypatch.chdir(tmp_path)
    computed_once(tmp_path_factory, monkeypatch, *OF_SESSIONS, *OF_TABLES)
    shown = json.loads(notebook.read_text(encoding="utf-8"))
    code = [cell for cell in shown["cells"] if cell["cell_type"] == "code"]
    for before, now in zip(code, executed(shown), strict=True):
        assert printed(now) == printed(before)
        assert len(now["outputs"]) == len(before["outputs"])


@pytest.mark.slow
def test_the_ten_tasks_have_types():
    shown = json.loads((NOTEBOOKS[0].parent / "python.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in shown["cells"] if cell["cell_type"] == "code"]
    # Beside what mypy has kept of the package, and under one name: mypy looks again only at what has changed since.
    script = NOTEBOOKS[0].parents[1] / ".mypy_cache" / "ten_tasks.py"
    script.parent.mkdir(exist_ok=True)
    # `--strict` on the command line would undo an exception of the settings, and mypy look at the whole package anew, twice.
    script.write_text("\n\n".join(["# mypy: warn-return-any", *cells]), encoding="utf-8")
    # From the checkout, for its settings, which are strict, and what its check of types has kept of the package.
    line = [sys.executable, "-m", "mypy", str(script)]
    done = subprocess.run(line, capture_output=True, text=True, check=False, cwd=NOTEBOOKS[0].parents[1])
    assert done.returncode == 0, done.stdout
