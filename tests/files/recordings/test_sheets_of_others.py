"""Sheets as other people's programs write them: encodings, separators at ends of lines, decimal commas, nominal beside measured columns."""

from __future__ import annotations

import codecs

import pytest

from dbbstation.errors import InputError
from dbbstation.files.recordings.cmm_sheet import read_sheet
from dbbstation.files.recordings.foreign_csv import read_foreign

CENTRES = {"9-short": (0.0254, -0.0143, 0.0069), "4-short": (-100.0441, -100.0024, 0.0273)}


def sheet(head, sign="\t", comma=".", ends="", unit=1.0):
    rows = [
        sign.join([name, *(f"{value / unit:.6f}".replace(".", comma) for value in of)]) for name, of in CENTRES.items()
    ]
    return "\r\n".join([head + ends, *(row + ends for row in rows)]) + "\r\n"


def read(tmp_path, data, **more):
    path = tmp_path / "sheet.txt"
    path.write_bytes(data)
    return {one.name: one.centre_mm for one in read_sheet(path, {}, None, None, **more)}


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (sheet("Kugel;X [mm];Y [mm];Z [mm]", ";", ","), "cp1252"),
        (sheet("Name\tX\tY\tZ\tPrüfer".removesuffix("\tPrüfer")), "utf-8"),
        ("Prüfer: Müller\r\nMaße in mm\r\n" + sheet("Name;X;Y;Z", ";", ","), "cp1252"),
        ("検査成績書\r\n" + sheet("要素名\tX\tY\tZ"), "cp932"),
        (sheet("要素名\tX\tY\tZ"), "utf-16-le"),
        (sheet("Name,X,Y,Z", ","), "utf-16-be"),
        (sheet("要素名\tX\tY\tZ"), "utf-8-sig"),
        (sheet("Name\tX\tY\tZ", ends="\t"), "ascii"),
        (sheet("Name;X;Y;Z", ";", ends=";"), "ascii"),
        (sheet("Name;X;Y;Z", ";", ",", ends=";"), "ascii"),
        (sheet("Name;X [in];Y [in];Z [in]", ";", unit=25.4), "ascii"),
    ],
)
def test_it_has_the_same_centres(tmp_path, text, encoding):
    found = read(tmp_path, text.encode(encoding))
    for name, centre in CENTRES.items():
        assert found[name] == pytest.approx(centre, abs=2e-5)


def test_a_byte_order_mark_counts_more_than_what_is_stated(tmp_path):
    data = codecs.BOM_UTF16_LE + sheet("Name\tX\tY\tZ").encode("utf-16-le")
    assert set(read(tmp_path, data, encoding="cp1252")) == set(CENTRES)


def test_rows_alone_may_end_with_a_separator(tmp_path):
    head, *rows = sheet("Name;X;Y;Z", ";").splitlines()
    assert set(read(tmp_path, "\n".join([head, *(f"{row};" for row in rows)]).encode())) == set(CENTRES)


@pytest.mark.parametrize(
    "head",
    [
        "Name;X Soll [mm];Y Soll [mm];Z Soll [mm];X Ist [mm];Y Ist [mm];Z Ist [mm]",
        "Feature;Nom X;Nom Y;Nom Z;Act X;Act Y;Act Z",
        "name;nominal_x_mm;nominal_y_mm;nominal_z_mm;meas_x_mm;meas_y_mm;meas_z_mm",
        "Name;X nominal;Y nominal;Z nominal;X;Y;Z",
    ],
)
def test_measured_columns_are_taken_beside_nominal_ones(tmp_path, head):
    rows = [f"{name};0;0;0;{';'.join(map(str, of))}" for name, of in CENTRES.items()]
    assert read(tmp_path, "\n".join([head, *rows, ""]).encode()) == CENTRES


def test_a_row_per_coordinate_in_japanese_takes_the_measured_one(tmp_path):
    lines = ["要素名\t座標名\t実測値\t基準値\t偏差"]
    lines += [
        f"{name}\t{axis}\t{value}\t0.0\t{value}"
        for name, of in CENTRES.items()
        for axis, value in zip("XYZ", of, strict=True)
    ]
    lines += [f"{name}\tD\t20.0003\t20\t0.0003" for name in CENTRES]
    assert read(tmp_path, "\r\n".join(lines).encode("cp932")) == CENTRES


@pytest.mark.parametrize("encoding", ["cp1251", "gb18030", "cp1250"])
def test_an_encoding_that_is_in_doubt_is_asked_for(tmp_path, encoding):
    head = {"cp1251": "Измеритель", "gb18030": "测量机构名称", "cp1250": "Měřřříž"}[encoding]
    data = (f"{head}\n" + sheet("Name;X;Y;Z", ";")).encode(encoding)
    with pytest.raises(InputError, match="is not UTF-8 text; say --encoding"):
        read(tmp_path, data)
    assert set(read(tmp_path, data, encoding=encoding)) == set(CENTRES)


def test_a_row_that_is_no_number_is_named(tmp_path):
    text = sheet("Name;X;Y;Z", ";").replace("-100.002400", "***")
    with pytest.raises(InputError, match=r"sheet\.txt:3: Y is `\*\*\*`, not a finite number"):
        read(tmp_path, text.encode())


def test_files_of_the_trade_are_read(recordings):
    """Small files from people who do this job, beside the checkout."""
    cases = recordings / "real" / "cases"
    expected = {"cp1252.csv": 3, "cmm-cp932.txt": 5, "trailsemi.txt": 2, "trailtab.txt": 2}
    for name, balls in expected.items():
        found = read_sheet(cases / name, {}, None, None)
        assert len(found) == balls
        assert {one.name: one.centre_mm for one in found}["9-short"] == pytest.approx(CENTRES["9-short"], abs=1e-9)
    log = read_foreign(cases / "bar-log-tab.txt")
    assert log.table.names == ("Angle [deg]", "Deviation [um]")
    assert log.table.values["Deviation [um]"][0] == 17.0
