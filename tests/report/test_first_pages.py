"""What the first page says: a verdict, whether this is a certificate, whether the model failed, U and what is not in it."""

from __future__ import annotations

import pytest

from dbbstation.cli import FAILED
from dbbstation.plan.tolerance import CircleFigure
from tests.browser import Browser, chromium
from tests.cli.conftest import call
from tests.cli.test_report_command import Page
from tests.once import made_once
from tests.report.first_pages import PLACE, four_reports, read_reports, settings_in

A4 = (int((210 - 2 * 14) / 25.4 * 96), int((297 - 14 - 16) / 25.4 * 96))
"""Width and height between the margins of the page [CSS px]."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return made_once(tmp_path_factory, "pages", four_reports)


@pytest.fixture(scope="module")
def reports(folder):
    return read_reports(folder)


def first_page(reports, name):
    text = Page(reports[name][0].read_text("utf-8")).text
    return text.split("Conditions machine", 1)[0]


def test_all_is_well(reports):
    _, data = reports["well"]
    page = first_page(reports, "well")
    assert data["verdict"]["kind"] == "within"
    assert data["certificate"] == {"title": "Certificate of circular tests", "lacking": [], "place": PLACE}
    assert "Certificate of circular tests , report " in page
    assert "Not a certificate" not in page
    for told in (PLACE, "HX-0017", "A. Mori", "order 4711", "DBB-0042, calibrated 2026-11-20 at 20.0 °C", "anchor "):
        assert told in page, told


def test_a_tolerance_is_exceeded_and_the_causes_are_ranked(reports):
    _, data = reports["exceeded"]
    page = first_page(reports, "exceeded")
    assert data["verdict"]["kind"] == "exceeded"
    assert "NOT within the shop's tolerances" in page
    assert "The model failed" not in page
    ranked = [one["cause"] for one in data["causes"]]
    assert ranked == ["geometry", "gravity"]
    assert page.index("Cause 1, geometry") < page.index("Cause 2, gravity")


def test_the_model_failed(reports):
    _, data = reports["failed"]
    page = first_page(reports, "failed")
    assert "The model failed" in page
    assert "physics is missing" in page.lower()
    assert data["causes"] == []
    assert "Cause 1" not in page


def test_it_is_no_certificate(reports):
    path, data = reports["bare"]
    page = first_page(reports, "bare")
    lacking = data["certificate"]["lacking"]
    assert "operator unknown" in lacking
    assert "not sealed" in lacking
    assert "place unknown" in lacking
    assert ": serial number of the machine unknown, calibrator's certificate unknown" in page
    title = path.read_text("utf-8").split("<title>")[1].split("</title>")[0]
    assert title.startswith("Not a certificate: serial number of the machine unknown")


def test_a_certificate_is_refused_where_something_is_lacking(folder, tmp_path):
    out = tmp_path / "refused.html"
    words = ("report", folder / "bare", "--certificate", "--place", PLACE, "--page", out)
    done = call("--settings", settings_in(tmp_path), *words)
    assert done.code == FAILED
    assert "operator unknown" in done.err
    assert not out.exists()


@pytest.mark.parametrize("name", ["well", "exceeded", "failed", "bare"])
def test_u_and_what_is_not_in_it_stand_on_the_first_page_and_once(reports, name):
    path, data = reports[name]
    page = first_page(reports, name)
    assert "U = 2 u" in page
    assert "Not in U: " in page
    assert Page(path.read_text("utf-8")).text.count("= 2 u") == 1
    for words in ("within", "exceeded", "cannot tell", "good", "repeat"):
        assert words in page.split("Of a tolerance")[1]
    assert [one["quantity"] for one in data["tolerances"]] == [str(figure) for figure in CircleFigure]


def test_every_tolerance_is_held_against_the_figure_of_circles_with_its_filter(folder, reports):
    """The table of `circles` with the same filter has the same figures and uncertainties."""
    _, data = reports["exceeded"]
    held = {one["quantity"]: one for one in data["tolerances"]}
    at = {upr: call("circles", folder / "bent", "--filter", upr, "--json").data for upr in ("15", "30", "50")}

    def greatest(rows, size):
        return max(abs(size(row)) for row in rows)

    expected = {
        "circular-deviation": greatest(at["30"]["runs"], lambda run: run["g_least_squares_um"]),
        "radial-deviation": greatest(
            at["50"]["runs"], lambda run: max(run["f_um"]["max"], run["f_um"]["min"], key=abs)
        ),
        "bidirectional-circular-deviation": greatest(at["30"]["pairs"], lambda pair: pair["g_least_squares_um"]),
        "mean-bidirectional-radial-deviation": greatest(at["30"]["pairs"], lambda pair: pair["d_um"]),
        "circular-hysteresis": greatest(at["15"]["pairs"], lambda pair: pair["h_um"]),
    }
    for quantity, um in expected.items():
        assert held[quantity]["worst"]["um"] == pytest.approx(um, rel=1e-9), quantity
        limit, u = held[quantity]["largest_um"], held[quantity]["worst"]["expanded_um"]
        says = "within" if um + u <= limit else "exceeded" if um - u > limit else "cannot tell"
        assert (held[quantity]["conformity"] == says) or held[quantity]["exceeded"] > 0
    assert held["circular-hysteresis"]["filter"] == "Gaussian, 15 UPR"
    assert held["mean-radial-error"]["filter"] is None


@pytest.mark.skipif(chromium() is None, reason="no Chromium on the PATH")
def test_on_paper_all_of_it_and_room_to_sign_fit_the_first_page(reports):
    with Browser() as browser:
        for name, (path, _) in reports.items():
            browser.open(path, size=A4, paper=True)
            assert browser.run("document.querySelector('.sign').getBoundingClientRect().bottom") < A4[1], name
            assert browser.run("document.querySelector('.sign').checkVisibility()"), name
            forced = (
                "[...document.querySelectorAll('main *')].filter(one => getComputedStyle(one).breakBefore === 'page')"
            )
            assert browser.run(f"{forced}.length") == 0, name
