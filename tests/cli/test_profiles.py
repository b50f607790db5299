"""A profile wherever an instrument is chosen; the byte log of any line; what an instrument is too slow for."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from dbbstation.files.places import shipped_folder
from dbbstation.instrument.library import load_instrument, with_zero
from dbbstation.virtual.wire import VirtualInstrument
from dbbstation.virtual.wire_clock import ScaledClock

if TYPE_CHECKING:
    from pathlib import Path

PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"
OLD = load_instrument("streaming-encoder", "no-checksum")
DONE, FAILED, USAGE = 0, 1, 2


def rows_of(out: str) -> list[dict]:
    return [json.loads(line) for line in out.splitlines()]


def test_monitor_takes_a_profile_and_spies_and_replay_knows_both(run, tmp_path: Path):
    spy = tmp_path / "bytes.txt"
    with VirtualInstrument(OLD, lambda _: 150.0) as virtual:
        line = ("--instrument", "streaming-encoder", "--profile", "no-checksum", "--port", virtual.port)
        outcome = run("instrument", "monitor", *line, "--count", "5", "--json", "--spy", spy)
        again = run("instrument", "monitor", *line, "--count", "1", "--spy", spy)
    assert outcome.code == DONE, outcome.err
    rows = rows_of(outcome.out)
    assert [row["length_mm"] for row in rows[:-1]] == [150.0] * 5
    assert rows[-1]["totals"]["rejected"] == {}
    assert again.code == FAILED
    assert "exists already" in again.err
    assert "# instrument: streaming-encoder\n# profile: no-checksum\n" in spy.read_text()
    replayed = run("instrument", "replay", spy, "--json")
    assert [one["length_mm"] for one in replayed.data["readings"]][:5] == [150.0] * 5
    assert not run("instrument", "replay", spy, "--profile", "crc", "--json").data["readings"]


def test_a_relative_display_is_read_from_its_zero(run):
    gauge = with_zero(load_instrument("tesa-tt80"), 150.0)
    with VirtualInstrument(gauge, lambda _: 150.0003, clock=ScaledClock(5)) as virtual:
        line = ("--instrument", "tesa-tt80", "--port", virtual.port, "--count", "2", "--json")
        missing = run("instrument", "monitor", *line)
        outcome = run("instrument", "monitor", *line, "--zero-mm", "150.0")
    assert missing.code == FAILED
    assert "give the calibrated length with --zero-mm" in missing.err
    rows = rows_of(outcome.out)
    assert rows[0]["length_mm"] == pytest.approx(150.0003)
    assert rows[0]["t_uncertainty_s"] > 0.0


def test_instruments_shows_the_profile_and_names_the_others(run):
    shown = run("instrument", "list", "keyence-dl-rs1a", "--profile", "gt-70a", "--json").data
    assert shown["profile"] == "gt-70a"
    assert shown["profiles"] == ["gt2", "gt-70a", "il", "il-300"]
    assert (
        "profile   gt-70a (there are gt2, gt-70a, il, il-300)"
        in run("instrument", "list", "keyence-dl-rs1a", "--profile", "gt-70a").out
    )
    wrong = run("instrument", "list", "keyence-dl-rs1a", "--profile", "gt-71")
    assert "did you mean gt-70a?" in wrong.err
    assert run("instrument", "list", "--profile", "gt-70a").code == USAGE


def settings(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "own.yaml"
    path.write_text(f"format: dbb-settings/1\n{text}")
    return path


def test_settings_have_a_profile_that_belongs_to_their_instrument(run, tmp_path: Path):
    own = settings(tmp_path, "instrument: streaming-encoder\nprofile: no-checksum\n")
    with VirtualInstrument(OLD, lambda _: 150.0) as virtual:
        taken = run("--settings", own, "instrument", "monitor", "--port", virtual.port, "--count", "1")
    assert taken.code == DONE, taken.err
    assert "--instrument streaming-encoder, --profile no-checksum" in taken.err
    # Another instrument on the command line is not asked for a profile of this one.
    other = run(
        "--settings", own, "instrument", "monitor", "--instrument", "heidenhain-nd281b", "--port", "/dev/ttyNONE9"
    )
    assert "there is no such port" in other.err
    alone = run("check", settings(tmp_path, "profile: no-checksum\n"))
    assert alone.code == FAILED
    assert "a profile needs `instrument` in the same file" in alone.err


def test_check_says_what_a_plan_gets_from_an_instrument(run, tmp_path: Path):
    said = run("check", PLAN, "--instrument", "heidenhain-nd281b")
    assert said.code == DONE, said.err
    assert "heidenhain-nd281b (profile stx) takes 14 readings per second: at least 790 points per turn" in said.out
    quick = tmp_path / "quick.yaml"
    quick.write_text(PLAN.read_text().replace("feed_mm_min: 1000", "feed_mm_min: 20000"))
    assert "20000" in quick.read_text()
    shown = run("check", quick, "--instrument", "heidenhain-nd281b", "--json")
    circles = shown.data["sampling"][0]["circles"]
    # 1/20 of the points of the same circle at a twentieth of the feed.
    assert circles[0]["points_per_turn"] == pytest.approx(789.5 / 20, rel=1e-3)
    assert not circles[0]["enough"]
    text = run("check", quick, "--instrument", "heidenhain-nd281b").out
    assert "too slow for test a, b" in text
    assert "undulations above 19 per revolution are not seen" in text
    assert "or a higher baud rate" in text


def test_check_reads_protocol_files_with_all_their_profiles(run, tmp_path: Path):
    shipped = shipped_folder("protocols") / "instruments" / "tesa-tt80.yaml"
    assert "instrument tesa-tt80: tt90, tt80, tt80-um, tt80-inch" in run("check", shipped).out
    wrong = tmp_path / "tesa-tt80.yaml"
    wrong.write_text(shipped.read_text().replace("    length:\n      unit: inch", "    length:\n      unit: yard"))
    outcome = run("check", wrong)
    assert outcome.code == FAILED
    line = next(n for n, text in enumerate(wrong.read_text().splitlines(), start=1) if "yard" in text)
    assert f"tesa-tt80.yaml:{line}:" in outcome.err


def test_measure_says_before_the_port_is_opened_what_it_will_see(run, tmp_path: Path):
    machine = shipped_folder("fixtures") / "machines" / "reference.yaml"
    words = ("--plan", PLAN, "--machine", machine, "--out", tmp_path / "session", "--port", "/dev/ttyNONE9")
    outcome = run("measure", *words, "--instrument", "heidenhain-nd281b", "--baud", "110")
    assert outcome.code == FAILED
    notes = [line for line in outcome.err.splitlines() if line.startswith("note:")]
    assert "readings per second" in notes[0]
    assert "too slow for test" in notes[1]


@pytest.mark.parametrize(("profile", "reaches"), [("um", False), ("mm", True)])
def test_a_feed_in_beyond_the_range_of_the_instrument_is_refused(run, tmp_path: Path, profile: str, reaches: bool):  # noqa: FBT001 (a parameter of the test)
    """A Millimar in µm shows 999.99 µm at most; the plan feeds in by 1.5 mm."""
    machine = shipped_folder("fixtures") / "machines" / "reference.yaml"
    words = ("--plan", PLAN, "--machine", machine, "--out", tmp_path / "session", "--port", "/dev/ttyNONE9")
    outcome = run(
        "measure",
        *words,
        "--instrument",
        "mahr-c1202",
        "--profile",
        profile,
        "--zero-mm",
        "150.0",
        "--bar-waiver",
        "no port is there",
    )
    assert outcome.code == FAILED
    said = "test a: the bar goes from 150 to 151.5 mm with its feed-in, and the instrument reads 149 to 151 mm"
    assert (said in outcome.err) != reaches
    assert ("there is no such port" in outcome.err) == reaches
    assert not (tmp_path / "session").exists()
