"""The notebook of the documentation runs, says what is true of what it invents, and shows what it prints."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.docs.notebooks import executed, printed

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "mismatch.ipynb"


@pytest.mark.slow
def test_the_notebook_prints_what_it_shows(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    code = [cell for cell in shown["cells"] if cell["cell_type"] == "code"]
    for before, now in zip(code, executed(shown), strict=True):
        assert printed(now) == printed(before)
        assert len(now["outputs"]) == len(before["outputs"])
