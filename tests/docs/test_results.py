"""Results of studies that the validation page is made of: complete, and all of them on the page."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
RESULTS = sorted((DOCS / "validation").glob("*.json"))


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.stem)
def test_a_result_says_how_it_was_made(path):
    kept = json.loads(path.read_text("utf-8"))
    assert kept["question"].endswith("?")
    assert kept["command"]
    assert re.fullmatch(r"2\d{3}-\d\d(-\d\d)?", kept["date"])
    assert {len(cells) for cells in kept["figures"].values()} == {len(kept["columns"])}


def test_the_page_has_every_result():
    page = (DOCS / "validation.md").read_text("utf-8")
    assert sorted(re.findall(r"_generated/validation/(.+?)\.inc", page)) == [path.stem for path in RESULTS]


def test_a_result_becomes_a_table(tmp_path):
    spec = importlib.util.spec_from_file_location("generate", DOCS / "generate.py")
    generate = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(generate)
    kept = {"question": "How far?", "data": "Two.", "command": "measure", "date": "2026-11-26", "seed": 7}
    kept |= {"columns": ["x", "y"], "figures": {"a": [1, "2.0"]}, "limits": "Few."}
    (tmp_path / "one.json").write_text(json.dumps(kept), "utf-8")
    expected = "**How far?** Two.\n\n|  | x | y |\n| --- | --- | --- |\n| a | 1 | 2.0 |\n\nFew. `measure`, seed 7, 2026-11-26.\n"
    assert dict(generate.results(tmp_path)) == {"one": expected}
