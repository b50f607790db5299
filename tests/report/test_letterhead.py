"""Customer, picture and budget in a report."""

from __future__ import annotations

import base64
import re
import zlib
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.files.places import shipped_folder
from tests.cli.conftest import call

if TYPE_CHECKING:
    from pathlib import Path

SESSION = shipped_folder("fixtures") / "sessions" / "small"


def picture() -> bytes:
    """One white pixel [PNG specification, sections 5 and 11]."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return len(data).to_bytes(4) + name + data + zlib.crc32(name + data).to_bytes(4)

    head = (1).to_bytes(4) + (1).to_bytes(4) + bytes([8, 0, 0, 0, 0])
    parts = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0\xff")) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def settings(folder: Path) -> Path:
    path = folder / "settings.yaml"
    path.write_text("format: dbb-settings/1\nreport: {customer: Example & Sons, logo: logo.png}\n", "utf-8")
    return path


@pytest.fixture
def page(tmp_path: Path) -> str:
    (tmp_path / "logo.png").write_bytes(picture())
    told = call("--settings", settings(tmp_path), "report", SESSION, "--page", tmp_path / "page.html")
    assert told.code == 0, told.err
    return (tmp_path / "page.html").read_text("utf-8")


def test_the_shops_picture_and_its_customer_head_the_report(page: str) -> None:
    assert "Customer: Example &amp; Sons" in page
    found = re.search(r'src="data:image/png;base64,([^"]+)"', page)
    assert found is not None
    assert base64.b64decode(found[1]) == picture()


def test_the_terms_of_the_budget_make_u(page: str) -> None:
    table = page.split("after ISO/TR 230-9")[1].split("</table>", maxsplit=1)[0]
    rows = [re.findall(r'<td class="n">([^<]*)</td>', row) for row in table.split("<tr>")[2:]]
    assert len(rows) > 2
    known = 0
    for *terms, together in zip(*rows, strict=True):
        if together != "–":
            known += 1
            squares = sum(float(term) ** 2 for term in terms if term != "–")
            assert float(together) == pytest.approx(np.sqrt(squares), abs=1e-3)
    assert known > 0


@pytest.mark.parametrize(("content", "says"), [(None, "there is no such file"), (b"<svg/>", "no PNG or JPEG picture")])
def test_a_picture_that_is_none_is_refused(tmp_path: Path, content: bytes | None, says: str) -> None:
    if content is not None:
        (tmp_path / "logo.png").write_bytes(content)
    told = call("--settings", settings(tmp_path), "report", SESSION, "--page", tmp_path / "page.html")
    assert told.code == 1
    assert says in told.err
    assert not (tmp_path / "page.html").exists()
