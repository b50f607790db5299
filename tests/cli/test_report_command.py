"""`dbbstation report`: its numbers, its words, and what people typed."""

from __future__ import annotations

import base64
import hashlib
import html.parser
import os
import re
import shutil
import stat
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import rice

from dbbstation.cli import DONE, FAILED
from dbbstation.facts.digits import with_uncertainty
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.run_csv import read_run
from tests.cli.conftest import call
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

SMALL = shipped_folder("fixtures") / "sessions" / "small"
MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
VOID = {"meta", "link", "br", "img", "input", "hr"}
EVIL = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report") / "session"
    plan = subset(table_ii_plan(4), ["a", "f"])
    record(folder, seed=4, plan=plan, mechanisms=[RandomKinematics()], rate_hz=10.0)
    return folder


@pytest.fixture(scope="module")
def better(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report") / "better"
    record(folder, seed=5, plan=subset(table_ii_plan(4), ["a", "f"]), rate_hz=10.0)
    return folder


@pytest.fixture(scope="module")
def written(session, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "report.html"
    outcome = call("report", session, "--page", out, "--json")
    assert outcome.code == DONE, outcome.err
    return out.read_text("utf-8"), outcome.data


def copy_of(session, tmp_path, **changed):
    folder = tmp_path / "copy"
    shutil.copytree(session, folder)
    path = folder / "session.yaml"
    text = path.read_text("utf-8")
    for key, value in changed.items():
        text = re.sub(rf"^{key}:.*\n", "", text, flags=re.MULTILINE)
        text = text.replace(
            "plan: plan.yaml\n", f"plan: plan.yaml\n{key}: {value!r}\n" if value else "plan: plan.yaml\n"
        )
    path.write_text(text, "utf-8")
    return folder


class Page(html.parser.HTMLParser):
    """Tags that open and close as they must; text and attributes of a page."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.attributes, self.words = [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), (tag, names)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def test_it_has_the_figures_of_circles(session, written):
    text, data = written
    circles = call("circles", session, "--filter", "30", "--findings", "--json").data
    assert data["circles"]["runs"] == circles["runs"]
    assert data["circles"]["pairs"] == circles["pairs"]
    page = Page(text).text
    for run in circles["runs"]:
        g = with_uncertainty(run["g_least_squares_um"], 2 * run["uncertainty"]["G(LS)"]["u_um"])
        assert f"{run['test']} {run['direction']} {run['repeat']} {g[0]} {g[1]} " in page
    for pair in circles["pairs"]:
        g = with_uncertainty(pair["g_least_squares_um"], 2 * pair["uncertainty"]["G(b)(LS)"]["u_um"])
        assert f"{pair['test']} both {pair['repeat']} {g[0]} {g[1]} " in page


def test_a_report_has_one_g(written):
    _, data = written
    assert data["circles"]["filter"] == "30 UPR, cut off sharply"
    for row, run in zip(data["measured"], data["circles"]["runs"], strict=True):
        size = row["now"]["circular-deviation"]
        assert (size["um"], size["u_um"]) == (run["g_least_squares_um"], run["uncertainty"]["G(LS)"]["u_um"])


def test_it_is_sound_html_and_refers_to_nothing_outside(written):
    text, _ = written
    page = Page(text)
    assert text.startswith("<!DOCTYPE html>")
    assert (
        page.tags.count("h1")
        == page.tags.count("main")
        == page.tags.count("title") - text.count("<g><title>") - (text.count("<polygon"))
    )
    assert page.tags.count("script") == 1
    assert "http:" not in text
    assert "https:" not in text
    assert "url(" not in text
    assert "@import" not in text
    ids = [value for name, value in page.attributes if name == "id"]
    assert len(ids) == len(set(ids))
    links = [value for name, value in page.attributes if name in {"href", "src", "xlink:href"}]
    assert {link.removeprefix("#") for link in links} <= set(ids)
    assert not [name for name, _ in page.attributes if name.startswith("on")]


def test_the_same_files_give_the_same_bytes(session, written, tmp_path):
    again = tmp_path / "other-name.html"
    assert call("report", session, "--page", again, "--json").code == DONE
    assert again.read_text("utf-8") == written[0]


def test_what_people_typed_is_escaped(session, tmp_path):
    folder = copy_of(session, tmp_path, operator=EVIL)
    plan = folder / "plan.yaml"
    plan.write_text(
        re.sub(r"^name:.*$", f"name: '{EVIL} & \"co\"'", plan.read_text("utf-8"), flags=re.MULTILINE), "utf-8"
    )
    out = tmp_path / "report.html"
    outcome = call("report", folder, "--job", f"'{EVIL}", "--page", out)
    assert outcome.code == DONE, outcome.err
    text = out.read_text("utf-8")
    page = Page(text)
    assert page.tags.count("script") == 1
    assert text.count("<script") == 1
    assert f"operator {EVIL}" in page.text
    assert f'plan {EVIL} & "co"' in page.text
    assert f"job '{EVIL}" in page.text


def test_the_page_allows_its_own_script_and_no_other(written):
    """The policy names the SHA-256 of what stands between the tags [CSP Level 3, 2.3.1]."""
    text, _ = written
    script = text.partition("<script>")[2].partition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'\"" in text
    assert "default-src 'none'" in text
    for reach in ("fetch", "XMLHttpRequest", "eval", "innerHTML", "import", "localStorage"):
        assert reach not in script


def test_traces_can_be_read_off(session, written):
    """From a drawn point and the figure's scale back to the deviation that `circles` has: its greatest and least."""
    text, data = written
    run = next(r for r in data["circles"]["runs"] if (r["test"], r["direction"]) == ("a", "ccw"))
    figure = text.partition('<figure class="polar">')[2]
    scale, radius = (float(re.search(rf'data-{name}="([0-9.]+)"', figure)[1]) for name in ("scale", "radius"))
    points = np.array([p.split(",") for p in re.search(r'ccw" points="([^"]*)"', figure)[1].split()], dtype=float)
    deviation = (np.hypot(*(points - 160.0).T) - radius) / scale
    # Places are given to a tenth of a unit.
    plain = call("circles", session, "--tests", "a", "--json").data["runs"][0]
    assert plain["direction"] == run["direction"]
    assert np.ptp(deviation) == pytest.approx(plain["uncertainty"]["G(LS)"]["as_read_um"], abs=0.2 / scale)
    assert 'data-name="CCW 1"' in figure


def settings(tmp_path, *limits):
    path = tmp_path / "settings.yaml"
    lines = [f"  - {{quantity: {name}, largest: {largest}, unit: µm}}\n" for name, largest in limits]
    path.write_text("format: dbb-settings/1\ntolerances:\n" + "".join(lines), "utf-8")
    return path


def test_the_first_page_holds_circles_against_the_tolerances(session, written, tmp_path):
    rows = written[1]["measured"]
    worst = max(rows, key=lambda row: row["now"]["centre-deviation"]["um"])
    size = worst["now"]["centre-deviation"]
    off = 2 * size["u_um"] + 0.1
    for largest, kind in ((size["um"], "cannot tell"), (size["um"] + off, "within"), (size["um"] - off, "exceeded")):
        out = tmp_path / f"{kind}.html"
        limits = settings(tmp_path, ("centre-deviation", f"{largest:.5f}"))
        outcome = call("--settings", limits, "report", session, "--page", out, "--json")
        assert outcome.data["verdict"]["kind"] == kind
        assert outcome.data["tolerances"][0]["worst"]["test"] == worst["test"]
        assert outcome.data["verdict"]["headline"] in out.read_text("utf-8").replace("&#39;", "'")
    assert written[1]["verdict"]["kind"] == "none"


def shown_in_the_median(centre_um, u_um):
    """Length of a centre offset whose measured lengths are of Rice's distribution with this one as its median."""
    length = np.hypot(*centre_um)
    u = np.hypot(*(centre_um / length * u_um))
    if rice.cdf(length / u, 0.0) <= 0.5:
        return 0.0
    return u * brentq(lambda true: rice.cdf(length / u, true) - 0.5, 0.0, length / u + 3.0, xtol=1e-12)


def test_before_and_now_stand_side_by_side_as_measured(session, better, tmp_path):
    out = tmp_path / "both.html"
    outcome = call("report", better, "--before", session, "--page", out, "--json")
    assert outcome.code == DONE, outcome.err
    # The offset of which half of all measured ones are shorter than this one: they are longer by their noise.
    centres = {
        name: [
            shown_in_the_median(
                np.array([run["centre_um"]["x"], run["centre_um"]["y"]]),
                np.array([run["uncertainty"][axis]["u_um"] for axis in "XY"]),
            )
            for run in call("circles", folder, "--json").data["runs"]
        ]
        for name, folder in (("before", session), ("now", better))
    }
    (row,) = [one for one in outcome.data["measured_means"] if one["quantity"] == "centre-deviation"]
    for when, sizes in centres.items():
        assert row[when]["mean_um"] == pytest.approx(np.mean(sizes), abs=1e-6)
        assert row[when]["largest_um"] == pytest.approx(max(sizes), abs=1e-6)
        assert f"{np.mean(sizes):.1f}" in Page(out.read_text("utf-8")).text
    assert out.read_text("utf-8").count('former" points') == 4
    assert "another nominal machine" not in out.read_text("utf-8")


def test_before_of_another_machine_is_said(session, tmp_path):
    machine = tmp_path / "copy" / "machine.yaml"
    folder = copy_of(session, tmp_path)
    text = machine.read_text("utf-8")
    joint = re.search(r"base_joints_mm:\D*(-?\d+\.\d+)", text)
    machine.write_text(text[: joint.start(1)] + f"{float(joint[1]) + 1.0:.6f}" + text[joint.end(1) :], "utf-8")
    out = tmp_path / "other.html"
    outcome = call("report", session, "--before", folder, "--page", out)
    assert outcome.code == DONE, outcome.err
    assert "The session before is of another nominal machine" in out.read_text("utf-8")


def test_a_model_stands_beside(tmp_path):
    out = tmp_path / "model.html"
    outcome = call("report", SMALL, "--model", MODEL, "--page", out, "--json")
    assert outcome.code == DONE, outcome.err
    evaluated = call("evaluate", SMALL, "--model", MODEL, "--json").data
    assert outcome.data["model"]["runs"] == evaluated["runs"]
    page = Page(out.read_text("utf-8")).text
    assert f"a flatness of {evaluated['flatness_um']:.1f} µm" in page
    assert "What was not visible" in page
    assert f"the model {evaluated['residual_rms_um']:.2f} µm" in page


def test_each_recording_is_read_once(tmp_path, monkeypatch):
    """Circles, evaluation and ranking need them, now and before."""
    before = shutil.copytree(SMALL, tmp_path / "before")
    counted = Counter()

    def read(path, *, sha256):
        counted[path] += 1
        return read_run(path, sha256=sha256)

    monkeypatch.setattr("dbbstation.files.recordings.session.read_run", read)
    outcome = call("report", SMALL, "--before", before, "--model", MODEL, "--page", tmp_path / "report.html")
    assert outcome.code == 0, outcome.err
    assert len(counted) == 12
    assert set(counted.values()) == {1}


def test_every_file_has_its_hash(session, written):
    page = Page(written[0]).text
    found = re.findall(r"sha256: ([0-9a-f]{64})", (session / "session.yaml").read_text("utf-8"))
    assert len(found) == 4
    for digest in found:
        assert digest in page


def test_one_direction_only(session, tmp_path):
    folder = copy_of(session, tmp_path)
    path = folder / "session.yaml"
    text = re.sub(r"(direction: \"?cw.*state: \"?)accepted", r"\1rejected", path.read_text("utf-8"))
    path.write_text(text, "utf-8")
    out = tmp_path / "one.html"
    outcome = call("report", folder, "--page", out, "--json")
    assert outcome.code == DONE, outcome.err
    assert {run["direction"] for run in outcome.data["circles"]["runs"]} == {"ccw"}
    assert "No test was measured in both directions" in Page(out.read_text("utf-8")).text


def test_no_accepted_run_is_said(session, tmp_path):
    folder = copy_of(session, tmp_path)
    path = folder / "session.yaml"
    path.write_text(re.sub(r"(state: \"?)accepted", r"\1rejected", path.read_text("utf-8")), "utf-8")
    outcome = call("report", folder, "--page", tmp_path / "none.html")
    assert outcome.code == FAILED
    assert "no accepted run is left" in outcome.err
    assert not (tmp_path / "none.html").exists()


def test_no_file_is_replaced_without_force(session, tmp_path):
    out = tmp_path / "there.html"
    out.write_text("mine")
    refused = call("report", session, "--page", out)
    assert refused.code == FAILED
    assert "--force" in refused.err
    assert out.read_text() == "mine"
    assert call("report", session, "--tests", "a", "--page", out, "--force").code == DONE


def test_a_pdf_needs_a_browser_and_says_which(session, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("DBBSTATION_CHROMIUM", raising=False)
    refused = call("report", session, "--page", tmp_path / "r.html", "--pdf", tmp_path / "r.pdf")
    assert refused.code == FAILED
    assert "install Chromium" in refused.err
    assert not (tmp_path / "r.html").exists()


@pytest.mark.slow
@pytest.mark.skipif(None in map(shutil.which, ("chromium", "unshare")), reason="no Chromium, or no unshare")
def test_a_pdf_needs_no_network(session, tmp_path):
    words = [
        sys.executable,
        "-m",
        "dbbstation",
        "report",
        session,
        "--tests",
        "a",
        "--page",
        "r.html",
        "--pdf",
        "r.pdf",
    ]
    alone = ["unshare", "--map-root-user", "--net", "--", *map(str, words)]
    if subprocess.run([*alone[:4], "true"], capture_output=True, check=False).returncode:
        pytest.skip("this system gives no namespace without a network")
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2]), "XDG_CONFIG_HOME": str(tmp_path)}
    done = subprocess.run(
        alone, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF-")


@pytest.mark.skipif(sys.platform == "win32", reason="the browser of this test is a script")
def test_a_browser_prints(session, tmp_path, monkeypatch):
    browser = tmp_path / "browser"
    browser.write_text(
        '#!/bin/sh\nfor a in "$@"; do case $a in --print-to-pdf=*) printf %%PDF > "${a#*=}";; esac; done\n'
    )
    browser.chmod(browser.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("DBBSTATION_CHROMIUM", str(browser))
    outcome = call("report", session, "--tests", "a", "--page", tmp_path / "r.html", "--pdf", tmp_path / "r.pdf")
    assert outcome.code == DONE, outcome.err
    assert (tmp_path / "r.pdf").read_bytes() == b"%PDF"
    browser.write_text("#!/bin/sh\necho no display >&2\nexit 3\n")
    failed = call("report", session, "--tests", "a", "--page", tmp_path / "s.html", "--pdf", tmp_path / "s.pdf")
    assert failed.code == FAILED
    assert "did not print: no display" in failed.err


def test_each_test_is_held_against_the_tolerances_before_and_now(session, better, tmp_path):
    """By hand from the figures of each circle: the decision rule of ISO 14253-1, the worst circle of a test stands for it."""
    limits = settings(tmp_path, ("centre-deviation", "18"), ("circular-deviation", "9"))
    outcome = call("--settings", limits, "report", better, "--before", session, "--page", tmp_path / "r.html", "--json")
    told = {(one["test"], one["quantity"]): one for one in outcome.data["tolerances_by_test"]}
    assert set(told) == {(test, name) for test in "af" for name in ("centre-deviation", "circular-deviation")}
    said = set()
    for (test, quantity), one in told.items():
        rows = [row for row in outcome.data["measured"] if row["test"] == test]
        for when, held in (("now", one), ("before", one["before"])):
            sizes = [row[when][quantity] for row in rows]
            limit = one["largest_um"]
            low, high = (max(size["um"] + sign * 2 * size["u_um"] for size in sizes) for sign in (-1, 1))
            expected = "exceeded" if low > limit else "within" if high <= limit else "cannot tell"
            assert held["conformity"] == expected
            assert held["worst"]["um"] == max(size["um"] for size in sizes)
            said.add((when, expected))
    assert len({kind for _, kind in said}) > 1, said
    before = outcome.data["tolerances"][0]["before"]
    assert before["worst"]["um"] == max(row["before"]["centre-deviation"]["um"] for row in outcome.data["measured"])
