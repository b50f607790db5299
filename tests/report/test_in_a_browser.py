"""The pages in a real browser: axe-core, keyboard, console and widths; desktop, phone and paper, light and dark."""

from __future__ import annotations

import re
import shutil

import pytest

from dbbstation.cli import DONE
from dbbstation.files.places import shipped_folder
from tests.browser import DESKTOP, PHONE, Browser, axe_script, chromium
from tests.cli.conftest import call
from tests.sessions_over_time import sessions_over_time

pytestmark = pytest.mark.skipif(chromium() is None, reason="no Chromium on the PATH")

SMALL = shipped_folder("fixtures") / "sessions" / "small"
MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
A4 = (int((210 - 2 * 14) / 25.4 * 96), 1017)
"""Width and height between the margins of the page [CSS px]."""

VIEWS = {
    "desktop, light": {"size": DESKTOP},
    "desktop, dark": {"size": DESKTOP, "dark": True},
    "phone": {"size": PHONE},
    "paper": {"size": A4, "paper": True},
}
AUDIT = """axe.run(document).then(found => found.violations.map(
  one => one.id + ": " + one.help + ": " + one.nodes.map(node => node.html.slice(0, 120)).join(" | ")))"""
REACHABLE = """[...document.querySelectorAll("a[href], button, input, select, textarea, summary, [tabindex='0']")]
  .filter(one => one.checkVisibility())"""
FOCUSED = f"""(() => {{
  const one = document.activeElement, style = getComputedStyle(one), box = one.getBoundingClientRect();
  return [{REACHABLE}.indexOf(one), one.matches(":focus-visible") && style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2,
    box.bottom > 0 && box.top < innerHeight, one.outerHTML.slice(0, 80)];
}})()"""


@pytest.fixture(scope="module")
def browser():
    with Browser() as one:
        yield one


def _report(folder):
    """Every part: before and now, a tolerance that is kept, one that is not, one that cannot be told, a model, findings, a long seal."""
    sealed = folder / "sealed"
    shutil.copytree(SMALL, sealed)
    assert call("session", "seal", sealed).code == DONE
    limits = (
        "{quantity: circular-deviation, largest: 1000, unit: µm}",
        "{quantity: centre-deviation, largest: 1, unit: µm}",
        "{quantity: mean-radial-error, largest: 5.3, unit: µm, tests: [a], directions: [ccw]}",
    )
    settings = folder / "settings.yaml"
    settings.write_text("format: dbb-settings/1\ntolerances:\n" + "".join(f"  - {one}\n" for one in limits), "utf-8")
    out = folder / "report.html"
    outcome = call(
        "--settings", settings, "report", sealed, "--before", SMALL, "--model", MODEL, "--job", "12", "--page", out
    )
    assert outcome.code == DONE, outcome.err
    assert all(f'class="said {kind} ' in out.read_text("utf-8") for kind in ("within", "exceeded", "cannot"))
    return out


def _history(folder):
    """A change, a single session that stands out, quantities that are steady."""
    sessions_over_time(folder / "sessions", 14, seed=2, step_at=12, step_um=12.0, long_at=11, long_um=30.0)
    out = folder / "history.html"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        outcome = call("history", folder / "sessions", "--page", out)
    assert outcome.code == DONE, outcome.err
    assert all(f'class="event {kind}"' in out.read_text("utf-8") for kind in ("changed", "stands"))
    return out


@pytest.fixture(scope="module", params=[_report, _history], ids=["report", "history"])
def page(request, tmp_path_factory):
    return request.param(tmp_path_factory.mktemp("page"))


def test_axe_finds_nothing_and_all_keys_reach_all(browser, page):
    axe = axe_script()
    if axe is None:
        pytest.skip("axe-core is not there: install axe-core-python, or name axe.min.js in DBBSTATION_AXE")
    for view, how in VIEWS.items():
        browser.open(page, **how)
        browser.run(f"{axe};0")
        assert browser.run(AUDIT) == [], view
        assert browser.complaints == [], view


def test_the_page_is_no_wider_than_the_screen_and_the_console_is_silent(browser, page):
    """Tables may be wider: on screens they have a frame of their own that scrolls, on paper there is none."""
    for view, how in VIEWS.items():
        browser.open(page, **how)
        assert browser.run("document.documentElement.scrollWidth") <= how["size"][0], view
        if "paper" in how:
            wide = "[...document.querySelectorAll('main *')].filter(one => one.getBoundingClientRect().right > innerWidth + 1)"
            assert browser.run(f"{wide}.map(one => one.outerHTML.slice(0, 80))") == []
        assert browser.complaints == [], view


def test_the_console_of_this_browser_would_not_be_silent(browser, tmp_path):
    spoilt = tmp_path / "spoilt.html"
    spoilt.write_text(
        "<meta http-equiv='Content-Security-Policy' content=\"default-src 'none'; script-src 'unsafe-inline'\">"
        "<script>no.such</script><img src='https://example.org/x.png'>"
    )
    browser.open(spoilt)
    heard = " ".join(browser.complaints)
    assert "no is not defined" in heard
    assert "example.org" in heard


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_tab_key_reaches_all_in_order_and_shows_where_it_is(browser, page, dark):
    browser.open(page, dark=dark)
    count = browser.run(f"{REACHABLE}.length")
    assert count >= 8
    for place in range(count):
        browser.press("Tab")
        at, outlined, seen, what = browser.run(FOCUSED)
        assert at == place, what
        assert outlined, what
        assert seen, what


def test_the_report_can_be_enlarged_by_keys_and_read_off_by_the_pointer(browser, tmp_path):
    out = tmp_path / "report.html"
    assert call("report", SMALL, "--tests", "a", "--page", out).code == DONE
    browser.open(out)
    figure = 'document.querySelector("figure.polar")'
    assert browser.run(f'{figure}.querySelectorAll("button").length') == 3
    left, top, width, height = browser.run(
        f"(() => {{ const svg = {figure}.querySelector('svg'); svg.scrollIntoView(); const box = svg.getBoundingClientRect();"
        "return [box.left, box.top, box.width, box.height]; })()"
    )
    browser.do("Input.dispatchMouseEvent", type="mouseMoved", x=left + 0.9 * width, y=top + height / 2)
    reading = browser.run(f'{figure}.querySelector(".reading").textContent')
    assert re.fullmatch(r"0°: CCW 1 [+−]\d+\.\d µm, CW 2 [+−]\d+\.\d µm", reading)
    browser.run(f'{figure}.querySelector("button").focus()')
    browser.press("Enter")
    box = f'{figure}.querySelector("svg").getAttribute("viewBox")'
    assert browser.run(box) == "80 80 160 160"
    browser.press("ArrowRight")
    assert browser.run(box) == "100 80 160 160"
