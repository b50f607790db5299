"""`dbbstation jig`: CMM sheets into jig files; how well holders repeat."""

from __future__ import annotations

import json
import re

import pytest

from dbbstation.cli import DONE, FAILED, USAGE
from dbbstation.files.formats.jig import read_jig
from dbbstation.files.places import shipped_folder

FIXTURES = shipped_folder("fixtures")
PLATE = FIXTURES / "jigs" / "reference-plate.yaml"
CMM = FIXTURES / "cmm"


def sheet(run, path, out, *more):
    return run("jig", "sheet", path, "--jig", PLATE, "--out", out, *more)


@pytest.mark.parametrize("unit", [("mm", 1.0), ("µm", 1e-3), ("inch", 25.4), ("m", 1e3)])
def test_a_sheet_of_a_jigs_own_balls_gives_that_jig(run, tmp_path, unit):
    name, factor = unit
    old = read_jig(PLATE)
    lines = [
        f"{ball.bore},{ball.holder},{','.join(repr(value / factor) for value in ball.centre_mm)},{2 * 0.8e-3 / factor!r}"
        for ball in old.balls.values()
    ]
    table = tmp_path / "cmm.csv"
    table.write_text("Bore,Holder,X,Y,Z,U\n" + "\n".join(lines) + "\n", encoding="utf-8")
    words = ["--unit", name, "--columns", "U=u", "--coverage", "2", "--cmm-temp-c", "20.1"]
    done = sheet(run, table, tmp_path / "new.yaml", *words)
    assert done.code == DONE, done.err
    new = read_jig(tmp_path / "new.yaml")
    assert (new.jig, new.holders) == (old.jig, old.holders)
    assert list(new.balls) == list(old.balls)
    for one, other in zip(new.balls.values(), old.balls.values(), strict=True):
        assert (one.bore, one.holder) == (other.bore, other.holder)
        assert one.centre_mm == pytest.approx(other.centre_mm, abs=1e-7)
        assert one.uncertainty_um == pytest.approx(0.8)
    told = json.loads((tmp_path / "new.yaml.provenance.json").read_text(encoding="utf-8"))
    assert set(told["inputs"]) == {"cmm.csv", "reference-plate.yaml"}


def test_a_table_with_units_and_decimal_commas_and_dmis_are_the_same_sheet(run, tmp_path):
    table = sheet(run, CMM / "plate.csv", tmp_path / "a.yaml", "--columns", "U (k=2)=u", "--coverage", "2", "--json")
    dmis = sheet(run, CMM / "plate.dmo", tmp_path / "b.yaml", "--u-um", "0.8", "--json")
    assert (table.code, dmis.code) == (DONE, DONE), table.err + dmis.err
    assert table.data["balls"] == dmis.data["balls"]
    one, other = read_jig(tmp_path / "a.yaml"), read_jig(tmp_path / "b.yaml")
    assert one == other
    assert one.jig.cmm_temp_c is None
    first = re.search(r"^9-short;([^;]*);", (CMM / "plate.csv").read_text("utf-8"), re.MULTILINE)
    assert one.balls["9-short"].centre_mm[0] == float(first[1].replace(",", "."))
    assert table.data["balls"]["9-short"]["change_um"][0] == pytest.approx(
        1e3 * (one.balls["9-short"].centre_mm[0] - read_jig(PLATE).balls["9-short"].centre_mm[0])
    )


def test_uncertainties_of_three_axes_become_their_root_mean_square(run, tmp_path):
    table = tmp_path / "cmm.csv"
    table.write_text("ball,x,y,z,a,b,c\n9-short,0,0,0,1e-3,2e-3,2e-3\n4-short,-100,-100,0,3e-3,0,0\n", encoding="utf-8")
    words = [word for one in ("a=ux", "b=uy", "c=uz") for word in ("--columns", one)]
    assert sheet(run, table, tmp_path / "new.yaml", *words, "--coverage", "1").code == DONE
    balls = read_jig(tmp_path / "new.yaml").balls
    assert [ball.uncertainty_um for ball in balls.values()] == pytest.approx([3.0**0.5, 3.0**0.5])


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("ball,x,y\n9-short,0,0\n4-short,-100,-100\n", "`9-short` has no z"),
        ("ball,x,y,z\n9-short,0,0,0\nball-x,-100,-100,0\n", "the jig has no ball `ball-x`"),
        ("ball,x,y,z\n9-short,0,0,0\n9-short,0,0,0\n", "is in the sheet a second time"),
        ("ball,x,y,z\n9-short,0,0,0\n4-short,100,100,0\n", "at bore 8"),
        ("ball,x,y,z\n9-short,0,0,0\n4-short,-100,abc,0\n", "cmm.csv:3: y is `abc`"),
        ("ball,a,b,c\n9-short,0,0,0\n4-short,-100,-100,0\n", "no column is known to be x"),
        ("x,y,z\n0,0,0\n-100,-100,0\n", "no column says which ball"),
        ("nothing", "there is no table"),
    ],
)
def test_sheets_that_are_no_jig_are_refused_with_their_line(run, tmp_path, text, what):
    table = tmp_path / "cmm.csv"
    table.write_text(text, encoding="utf-8")
    done = sheet(run, table, tmp_path / "new.yaml", "--u-um", "0.8")
    assert done.code == FAILED
    assert what in done.err
    assert not (tmp_path / "new.yaml").exists()


UNITS = "UNITS/MM,ANGDEC\n"
BALL = "FA(9_SHORT)=FEAT/SPHERE,OUTER,CART,0.1,0.2,0.3,20\n"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (BALL, "no unit is stated"),
        ("UNITS/CUBIT\n" + BALL, "`CUBIT` is no unit"),
        (UNITS + BALL.replace("FA(", "F("), "there is no measured sphere"),
        (UNITS + BALL.replace("CART", "POL"), "not in cartesian"),
        (UNITS + BALL.replace("0.2", "x"), "are not three numbers"),
        (UNITS + BALL + "RECALL/D(OTHER)\n" + BALL.replace("9", "4"), "the frame was set anew in line 3"),
    ],
)
def test_dmis_that_cannot_be_understood_is_refused(run, tmp_path, text, what):
    file = tmp_path / "plate.dmo"
    file.write_text(text, encoding="utf-8")
    done = sheet(run, file, tmp_path / "new.yaml", "--u-um", "0.8")
    assert done.code == FAILED
    assert what in done.err


def test_dmis_points_in_inch_with_other_names(run, tmp_path):
    file = tmp_path / "plate.dmis"
    file.write_text(
        "UNITS/INCH,ANGDEC\nFA(P1)=FEAT/POINT,CART,0.01,0.02,$ \n 0.03,0,0,1 $$ made up\n", encoding="utf-8"
    )
    done = sheet(run, file, tmp_path / "new.yaml", "--u-um", "0.8", "--names", "P1=9-short")
    assert done.code == DONE, done.err
    assert read_jig(tmp_path / "new.yaml").balls["9-short"].centre_mm == pytest.approx((0.254, 0.508, 0.762))
    assert "balls that the sheet lacks, left out of the new file: 4-short" in done.out


def test_ten_mountings_in_three_bores_go_into_the_jig(run, tmp_path):
    """Made with the scatter of [CAL III-B], 0.58 and 1.85 µm per axis: the truth lies in both intervals of this draw."""
    done = run("jig", "holders", CMM / "mountings.csv", "--jig", PLATE, "--out", tmp_path / "new.yaml", "--json")
    assert done.code == DONE, done.err
    for name, truth in (("short", 0.58), ("long", 1.85)):
        found = done.data["holders"][name]
        assert (found["places"], found["mountings"], found["together"]["degrees_of_freedom"]) == (3, 30, 81)
        assert found["together"]["low_um"] < truth < found["together"]["high_um"]
    old, new = read_jig(PLATE), read_jig(tmp_path / "new.yaml")
    assert new.balls == old.balls
    assert new.jig == old.jig
    assert new.holders["short"].repeatability_um == pytest.approx(
        done.data["holders"]["short"]["repeatability_um"], rel=1e-3
    )
    assert new.holders["long-on-riser"] == old.holders["long-on-riser"]
    assert run("check", tmp_path / "new.yaml").code == DONE


def test_bad_words_and_tables_of_mountings_are_answered(run, tmp_path):
    table = tmp_path / "m.csv"
    table.write_text("bore,x,y,z\n9,0,0,0\n4,1,1,1\n", encoding="utf-8")
    assert "which holder" in run("jig", "holders", table).err
    assert "each place has one mounting only" in run("jig", "holders", table, "--holder", "short").err
    assert run("jig", "holders", table, "--holder", "short", "--jig", PLATE).code == USAGE
    assert run("jig", "holders", table, "--columns", "x=colour").code == USAGE
    table.write_text("bore,x,y,z\n9,0,0,0\n9,1e-3,0,0\n", encoding="utf-8")
    other = run("jig", "holders", table, "--holder", "oak", "--jig", PLATE, "--out", tmp_path / "n.yaml")
    assert other.code == FAILED
    assert "the jig has no holder oak" in other.err
    (tmp_path / "n.yaml").write_text("mine", encoding="utf-8")
    assert (
        "--force" in run("jig", "holders", table, "--holder", "short", "--jig", PLATE, "--out", tmp_path / "n.yaml").err
    )
    assert run("jig", "sheet", CMM / "plate.dmo", "--jig", PLATE, "--out", tmp_path / "n.yaml").code == FAILED


def long_sheet(tmp_path, text, name="plate_chr.txt"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


CALYPSO = (
    "planid\tpartnb\tid\ttype\tidsymbol\tactual\tnominal\tuppertol\tfeatureid\tunit\n"
    "Plate\t1\tX_9\txValue\tX\t0.0254\t0.0\t0.1\t9-short\tmm\n"
    "Plate\t1\tY_9\tyValue\tY\t-14.3\t0.0\t0.1\t9-short\tµm\n"
    "Plate\t1\tZ_9\tzValue\tZ\t0.0069\t0.0\t0.1\t9-short\tmm\n"
    "Plate\t1\tD_9\tdiameter\tD\t25.0\t25.0\t0.1\t9-short\tmm\n"
    "Plate\t1\tX_4\txValue\tX\t-100.0441\t0.0\t0.1\t4-short\tmm\n"
    "Plate\t1\tY_4\tyValue\tY\t-100.0024\t0.0\t0.1\t4-short\tmm\n"
    "Plate\t1\tZ_4\tzValue\tZ\t0.0273\t0.0\t0.1\t4-short\tmm\n"
    "END\n"
)


def test_a_sheet_with_a_row_per_coordinate(run, tmp_path):
    done = sheet(run, long_sheet(tmp_path, CALYPSO), tmp_path / "new.yaml", "--u-um", "0.8")
    assert done.code == DONE, done.err
    balls = read_jig(tmp_path / "new.yaml").balls
    assert balls["9-short"].centre_mm == pytest.approx((0.0254, -0.0143, 0.0069), abs=1e-9)
    assert balls["4-short"].centre_mm == pytest.approx((-100.0441, -100.0024, 0.0273), abs=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("zValue\tZ\t0.0069", "diameter\tD\t0.0069", "9-short has no z"),
        ("Y\t-100.0024", "X\t-100.0024", "x of 4-short is in the sheet a second time"),
        ("-100.0441", "abc", "plate_chr.txt:6:6: actual of 4-short x is `abc`"),
        ("4-short\tmm\nEND", "4-short\tfoot\nEND", "plate_chr.txt:8:10: `foot` is no unit"),
    ],
)
def test_faults_of_such_a_sheet_have_line_and_column(run, tmp_path, old, new, what):
    assert old in CALYPSO
    done = sheet(run, long_sheet(tmp_path, CALYPSO.replace(old, new)), tmp_path / "new.yaml", "--u-um", "0.8")
    assert done.code == FAILED
    assert what in done.err


@pytest.mark.parametrize(
    ("head", "more"),
    [
        ("ball,x,y,z,U", ["--u-unit", "µm"]),
        ("ball,x,y,z,U [µm]", []),
        ("ball,x_mm,y_mm,z_mm,U_um", []),
        ("ball,x,y,z,U\n,mm,mm,mm,µm", []),
    ],
)
def test_uncertainties_have_a_unit_of_their_own(run, tmp_path, head, more):
    """A U of 1.6 µm (k = 2) beside coordinates in mm is a u of 0.8 µm, not 800."""
    table = tmp_path / "cmm.csv"
    table.write_text(f"{head}\n9-short,0,0,0,1.6\n4-short,-100,-100,0,1.6\n", encoding="utf-8")
    column = head.splitlines()[0].split(",")[-1]
    words = ["--columns", f"{column}=u", "--coverage", "2"]
    done = sheet(run, table, tmp_path / "new.yaml", *words, *more)
    assert done.code == DONE, done.err
    assert [one.uncertainty_um for one in read_jig(tmp_path / "new.yaml").balls.values()] == pytest.approx([0.8, 0.8])


def test_a_unit_of_uncertainties_that_nobody_says_is_refused_where_no_cmm_has_it(run, tmp_path):
    table = tmp_path / "cmm.csv"
    table.write_text("ball,x,y,z,U\n9-short,0,0,0,1.6\n4-short,-100,-100,0,1.6\n", encoding="utf-8")
    done = sheet(run, table, tmp_path / "new.yaml", "--columns", "U=u", "--coverage", "2")
    assert done.code == FAILED
    assert "cmm.csv:2" in done.err
    assert "--u-unit" in done.err
