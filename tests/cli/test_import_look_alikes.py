"""Tables as other programs write them: understood, asked about, or refused with a line; never taken for something else.

Every file has the same circle: 20 µm cos 2 theta, whose G is 40 µm, about a ball that stands 5 and -3 µm beside its place.
"""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.cli import DONE, FAILED, USAGE
from tests.cli.test_import_asks import taken
from tests.cli.test_import_command import ANGLES, UNKNOWN, WHERE, ellipse, imported

PAIRS = list(zip(ANGLES.tolist(), ellipse().tolist(), strict=True))


def comma(value):
    return f"{value:.3f}".replace(".", ",")


def rows(separator, number, end="\n"):
    return "".join(f"{number(a)}{separator}{number(d)}{end}" for a, d in PAIRS)


def point(value):
    return f"{value:.3f}"


UNDERSTOOD = {
    "utf-16 with mark, tabs, commas": ("Winkel [°]\tAbweichung [µm]\r\n" + rows("\t", comma, "\r\n")).encode("utf-16"),
    "sep= line of a spreadsheet": ("sep=;\nangle_deg;deviation_um\n" + rows(";", comma)).encode(),
    "separator at the end": ("angle_deg;deviation_um;\n" + rows(";", comma, ";\n")).encode(),
    "minus sign": ("angle_deg,deviation_um\n" + rows(",", point).replace("-", "\N{MINUS SIGN}")).encode(),
    "no-break spaces": ("angle_deg;deviation_um\n" + rows(";\u00a0", comma)).encode(),
    "spaces": ("angle_deg deviation_um\n" + rows(" ", point)).encode(),
    "columns of fixed width": (
        "  Angle (deg)   Radius error (um)\n" + "".join(f"{a:13.3f}{d:20.3f}\n" for a, d in PAIRS)
    ).encode(),
    "exponents": ("angle_deg,deviation_um\n" + rows(",", lambda value: f"{value:.6E}")).encode(),
    "inch": ("angle_deg,deviation_in\n" + "".join(f"{a:g},{d / 25400:.8f}\n" for a, d in PAIRS)).encode(),
    "Chinese": ("角度(°),偏差(µm)\n" + rows(",", point)).encode(),
    "Italian": ("Angolo [°];Scostamento [µm]\n" + rows(";", comma)).encode(),
    "a radius deviation is a deviation": ("Angle (deg),Radius deviation (um)\n" + rows(",", point)).encode(),
    "a nominal radius is no reading": (
        "angle_deg;nominal radius_mm;deviation_um\n" + "".join(f"{a:g};150;{d:.3f}\n" for a, d in PAIRS)
    ).encode(),
}

TITLED = "Run 1 CCW\nAngle (deg),Deviation (um)\n" + rows(",", point)

REFUSED = {
    "no names": (rows(",", point).encode(), "old.csv:1: no line above the numbers names the columns"),
    "utf-16 without mark": (
        ("angle_deg,deviation_um\n" + rows(",", point)).encode("utf-16-le"),
        "old.csv:1:1: every second byte is zero",
    ),
    "Shift-JIS": (("角度(度),偏差(um)\n" + rows(",", point)).encode("cp932"), "cp932 Japanese"),
    "thousands": (
        ("angle_deg;length_um\n" + "".join(f"{comma(a)};150.0{d + 50:.0f},0\n" for a, d in PAIRS)).encode(),
        "old.csv:2",
    ),
    "two decimal signs": (
        ("angle_deg;deviation_um\n" + "".join(f"{point(a)};{comma(d)}\n" for a, d in PAIRS)).encode(),
        "old.csv:2:1: there is no table of numbers in this file; the line `0.000;25,000`",
    ),
    "a unit in every cell": (
        ("angle;deviation\n" + "".join(f"{comma(a)}°;{comma(d)} µm\n" for a, d in PAIRS)).encode(),
        "old.csv:2:1: there is no table",
    ),
    "a summary below": (
        ("angle_deg,deviation_um\n" + rows(",", point) + "\nMean,0.0\n").encode(),
        "old.csv:363:1: angle_deg is `Mean`",
    ),
    "a name twice": (
        ("angle_deg,deviation_um,deviation_um\n" + "".join(f"{a:g},{d:g},0\n" for a, d in PAIRS)).encode(),
        "old.csv:1: the column `deviation_um` appears here more than once",
    ),
    "the same value in every row": (
        ("angle_deg,length_mm\n" + "".join(f"{a:g},150.0\n" for a, _ in PAIRS)).encode(),
        "old.csv:2: column 2, length_mm: it is 150 in every row",
    ),
    "a workbook": (b"PK\x03\x04" + bytes(100), "old.csv:1:1: this is an archive"),
    "an old workbook": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(100), "old.csv:1:1: this is an old Excel workbook"),
    "XML": (b"<?xml version='1.0'?>\n<Ballbar><Run/></Ballbar>", "old.csv:1:1: this is XML or HTML"),
    "HTML": (b"<html><table></table></html>", "old.csv:1:1: this is XML or HTML"),
    "half a turn": (
        ("angle_deg,deviation_um\n" + "".join(f"{a:g},{d:g}\n" for a, d in PAIRS[:180])).encode(),
        "no sample over 181.0 degrees",
    ),
    "a head for each run": ((TITLED + "\n" + TITLED).encode(), "old.csv:365: the names of the columns come again"),
}


@pytest.mark.parametrize("kind", UNDERSTOOD)
def test_what_is_understood_is_the_same_circle(run, tmp_path, kind):
    file = tmp_path / "old.csv"
    file.write_bytes(UNDERSTOOD[kind])
    done = imported(run, file, tmp_path / "s")
    assert done.code == DONE, done.err
    (circle,) = run("circles", tmp_path / "s", "--json").data["runs"]
    assert circle["g_least_squares_um"] == pytest.approx(40.0, abs=0.02)
    assert (circle["centre_um"]["x"], circle["centre_um"]["y"]) == pytest.approx((5.0, -3.0), abs=0.02)


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_not_understood_is_refused_with_its_line(run, tmp_path, kind):
    file = tmp_path / "old.csv"
    content, says = REFUSED[kind]
    file.write_bytes(content)
    done = imported(run, file, tmp_path / "s")
    assert done.code == FAILED, done.out
    assert says in done.err
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize(
    ("head", "asks"),
    [
        ("X [mm];Y [mm]", "--columns 'NAME=deviation:µm'"),
        ("Angle (°);CCW (µm)", "these are not understood: CCW (µm)"),
        ("angle;deviation", "--columns 'deviation=deviation:UNIT'"),
        ("angle_gon;deviation_um", "--columns 'angle_gon=angle:UNIT'"),
        ("Drehlage;deviation_um", "not understood: Drehlage, say --columns 'NAME=angle:deg'"),
    ],
)
def test_what_a_column_means_is_asked_for(run, tmp_path, head, asks):
    file = tmp_path / "old.csv"
    file.write_text(head + "\n" + rows(";", comma), encoding="utf-8")
    done = imported(run, file, tmp_path / "s")
    assert done.code == USAGE
    assert asks in done.err
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize("encoding", ["cp932", "gb18030"])
def test_east_asian_text_is_read_where_it_is_said(run, tmp_path, encoding):
    file = tmp_path / "old.csv"
    file.write_bytes(("角度(deg),誤差(um)\n" + rows(",", point)).encode(encoding))
    done = imported(run, file, tmp_path / "s", "--encoding", encoding)
    assert done.code == DONE, done.err


def test_runs_with_a_head_of_their_own_are_parted_and_raw_data_need_no_edit(run, tmp_path):
    back = "".join(f"{point(a)},{point(d)}\n" for a, d in reversed(PAIRS))
    second = "Run 2 CW\nDate: 20.11.2026 08:10\nAngle (deg),Deviation (um)\n" + back
    file = tmp_path / "old.csv"
    file.write_text("Ballbar export\nDate: 20.11.2026 08:04\n" + TITLED + "\n" + second, encoding="utf-8")
    done = taken(run, file, tmp_path / "s", "--runs", "old.csv=a-ccw,a-cw", "--split", "gaps", "--zone", "+01:00")
    assert done.code == DONE, done.err
    found = run("circles", tmp_path / "s", "--json").data["runs"]
    assert [one["direction"] for one in found] == ["ccw", "cw"]
    assert [one["g_least_squares_um"] for one in found] == pytest.approx([40.0, 40.0], abs=0.02)


def test_a_table_parted_by_spaces_is_read_with_its_mapping_again(run, tmp_path):
    file = tmp_path / "old.csv"
    file.write_bytes(UNDERSTOOD["columns of fixed width"])
    assert imported(run, file, tmp_path / "s", "--mapping", tmp_path / "m.yaml").code == DONE
    words = ["--out", tmp_path / "t", *WHERE, *UNKNOWN, "--runs", "old.csv=a-ccw", "--yes"]
    again = run("import", file, *words, "--mapping", tmp_path / "m.yaml")
    assert again.code == DONE, again.err


def test_gaps_between_digits_are_not_made_up(run, tmp_path):
    file = tmp_path / "old.csv"
    lines = [f"{a:.1f} {d:.3f}" for a, d in PAIRS]
    lines[200] = "200.0 1.0 2.0"
    file.write_text("angle_deg deviation_um\n" + "\n".join(lines) + "\n", encoding="utf-8")
    done = imported(run, file, tmp_path / "s")
    assert done.code == FAILED
    assert np.all([word in done.err for word in ("old.csv:", "no table of numbers")])
