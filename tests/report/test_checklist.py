"""A certificate has what auditors look for, and each printed page what makes it one of that report."""

from __future__ import annotations

import json
import re
from datetime import datetime
from pathlib import Path

import pytest

from dbbstation.files.places import shipped_folder
from tests.browser import Browser, chromium
from tests.cli.conftest import call
from tests.report.checklist import certificate, figures
from tests.report.pdf_text import pages_of
from tests.report.test_first_pages import A4

STORED = Path(__file__).resolve().parents[2] / "docs" / "validation" / "report-checklist.json"
SESSIONS = shipped_folder("fixtures") / "sessions"
needs_chromium = pytest.mark.skipif(chromium() is None, reason="no Chromium on the PATH")


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("audited") / "page.html"
    path.write_text(certificate(path.parent), "utf-8")
    return path


def test_the_stored_checklist_is_that_of_a_certificate_made_now(page: Path) -> None:
    found = figures(page.read_text("utf-8"))
    assert found == json.loads(STORED.read_text("utf-8"))["figures"]
    assert not [item for item, (there, _) in found.items() if there == "no"]


@needs_chromium
def test_head_and_verdict_of_a_certificate_leave_room_to_sign_on_the_first_page(page: Path) -> None:
    with Browser() as browser:
        browser.open(page, size=A4, paper=True)
        assert browser.run("document.querySelector('.sign').getBoundingClientRect().bottom") < A4[1]


@needs_chromium
@pytest.mark.parametrize("name", ["virtual", "small"])
def test_each_page_names_report_day_session_machine_and_a_virtual_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))  # Chromium keeps a folder there
    paper = tmp_path / "report.pdf"
    done = call("report", SESSIONS / name, "--page", tmp_path / "report.html", "--pdf", paper)
    assert done.code == 0, done.err
    number = re.search(r", report (\w{10}), issued", (tmp_path / "report.html").read_text("utf-8"))[1]
    pages = [" ".join(text.split()) for text in pages_of(paper.read_bytes())]
    assert len(pages) >= 2
    for at, text in enumerate(pages, start=1):
        head = text[:250]
        assert f"page {at} of {len(pages)}" in head
        assert f"report {number} · {name}" in head
        assert "machine no. PM600-0007" in head
        assert f"issued {datetime.now().astimezone():%Y-%m-%d}" in head
        assert ("VIRTUAL MACHINE" in head) is (name == "virtual")
