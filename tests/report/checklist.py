"""A certificate of a sealed session beside what ISO/IEC 17025 and ISO 230-4 want to read in it.

    python -m tests.report.checklist --out docs/validation/report-checklist.json

Items of ISO/IEC 17025:2017 are those of 7.8.2.1, 7.8.4.1, 7.8.4.3 and 7.8.8; those of ISO 230-4 are its list of what is stated
with a circle, as test reports of machine makers repeat it: its text was not at hand.
"""

from __future__ import annotations

import argparse
import html
import json
import re
import tempfile
from datetime import datetime
from pathlib import Path

from dbbstation.cli import DONE
from tests.cli.conftest import call
from tests.plant.noise import Noise
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record
from tests.report.first_pages import PLACE, complete, settings_in

LABORATORY, CUSTOMER = "Example Metrology, 1 Bar Street", "Example Works, 2 Ball Road"
NEEDLESS = "does not apply"

ITEMS = {
    "7.8.2.1 a title": "Certificate of circular tests",
    "7.8.2.1 b laboratory, address": f"Measured by {LABORATORY}",
    "7.8.2.1 c place": re.escape(PLACE),
    "7.8.2.1 d number, and end": r"report (\w{10}), issued .*End of report \1",
    "7.8.2.1 e customer": re.escape(CUSTOMER),
    "7.8.2.1 f method": r"Figures of ISO 230-4:2005",
    "7.8.2.1 g item": r"machine PM-600-like reference serial number HX-0017",
    "7.8.2.1 h date of receipt": NEEDLESS,
    "7.8.2.1 i date of the measurement": r"measured 2026-11-20",
    "7.8.2.1 j date of issue": f"issued {datetime.now().astimezone():%Y-%m-%d}",
    "7.8.2.1 k sampling plan": r"plan circles on the jig plate",
    "7.8.2.1 l only this item": r"hold for the machine named above, as it was measured",
    "7.8.2.1 m results with units": r"Measured \[µm\]",
    "7.8.2.1 n deviations from the method": r"about the least-squares circle, which the standard permits",
    "7.8.2.1 o who authorizes": r"signature",
    "7.8.2.1 p results of others": NEEDLESS,
    "7.8.4.1 a uncertainty": r"U = 2 u, the expanded uncertainty",
    "7.8.4.1 b conditions": r"temperature of the shop 20\.0 °C",
    "7.8.4.1 c traceability": r"calibrator B-7, D-K-15018-01 of 2026-03-02, valid until 2027-03-02 bar calibrated 150\.00000 mm, u 0\.5 µm",
    "7.8.4.1 d before and after": r"largest before largest now",
    "7.8.4.1 e decision rule": r"Of a tolerance \(ISO 14253-1\)",
    "7.8.4.1 f opinions": r"What to do",
    "7.8.4.3 no interval recommended": r"^(?!.*(interval|every \d+ (months|days)))",
    "7.8.8 amendments": r"0 amendments",
    "ISO 230-4 diameter": r"bar 150 mm",
    "ISO 230-4 feed": r"1000 mm/min",
    "ISO 230-4 direction": r"a ccw 1 .* a cw 1",
    "ISO 230-4 place in the working zone": r"about X \S+, Y \S+, Z -\d+\S* mm",
    "ISO 230-4 angles of other axes": r"not tilted",
    "ISO 230-4 temperature of the instrument": r"calibrated 2026-11-20 at 20\.0 °C",
    "ISO 230-4 temperature of the machine": r"logged temperatures none",
    "ISO 230-4 start, overlap, points": r"from 0°, \d+° more at either end, \d+ points",
    "ISO 230-4 filter": r"filter: 30 UPR",
    "ISO 230-4 compensation": r"0 of 8 accepted runs under NC programs",
}
"""What every item is found by in the text of the page."""


def certificate(folder: Path) -> str:
    """Return the page of a certificate, made in a folder."""
    plan, quiet = subset(table_ii_plan(4), list("abdg")), Noise(white_um=0.3)
    for name in ("before", "now"):
        record(folder / name, seed=5, plan=plan, noise=quiet, rate_hz=10.0)
    settings = settings_in(folder)
    settings.write_text(
        f"{settings.read_text('utf-8')}report: {{laboratory: '{LABORATORY}', customer: '{CUSTOMER}'}}\n", "utf-8"
    )
    words = [complete(folder / "now"), "--before", folder / "before", "--place", PLACE, "--certificate"]
    page = folder / "page.html"
    made = call("--settings", settings, "report", *words, "--page", page)
    assert made.code == DONE, made.err
    return page.read_text("utf-8")


def figures(page: str) -> dict[str, list[str]]:
    """Return of every item whether it is found, and in which part of the page first."""
    parts = re.split(r'<section[^>]*(?:id|aria-label)="(\w+)"', page.split("<body>")[1])
    names = ["heading", *parts[1::2]]
    texts = [plain(part) for part in parts[::2]]
    whole = " ".join(texts)
    return {
        item: [NEEDLESS, ""] if how == NEEDLESS else _found(how, names, texts, whole) for item, how in ITEMS.items()
    }


def plain(page: str) -> str:
    text = re.sub(r"<(script|svg)\b.*?</\1>", " ", page, flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", text)).split())


def _found(how: str, names: list[str], texts: list[str], whole: str) -> list[str]:
    if not re.search(how, whole):
        return ["no", ""]
    where = next((name for name, text in zip(names, texts, strict=True) if re.search(how, text)), "several")
    return ["yes", "whole page" if how.startswith("^(?!") else where.lower()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    with tempfile.TemporaryDirectory() as folder:
        found = figures(certificate(Path(folder)))
    kept = {
        "question": "Does a certificate have what ISO/IEC 17025:2017 (7.8) and ISO 230-4 ask for?",
        "data": "The report of a sealed session of eight circles beside one before.",
        "command": "python -m tests.report.checklist",
        "date": f"{datetime.now().astimezone():%Y-%m-%d}",
        "seed": 5,
        "columns": ["in the report", "first in"],
        "figures": found,
        "limits": "The text of ISO 230-4 was not at hand. `report.laboratory` and `report.customer` were set.",
    }
    out.write_text(json.dumps(kept, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    for item, cells in found.items():
        print(f"{item:45} {'  '.join(cells)}")  # noqa: T201


if __name__ == "__main__":
    main()
