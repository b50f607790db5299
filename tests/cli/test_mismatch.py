"""`dbbstation mismatch` as a person or a program calls it."""

from __future__ import annotations

import csv
import hashlib
import json
import shutil

import numpy as np
import pytest
from scipy.signal import lfilter

from dbbstation.cli import DONE, FAILED, USAGE
from dbbstation.files.places import shipped_folder
from tests.diagnosis.table import plant
from tests.diagnosis.table.plant import Truth, record

pytestmark = pytest.mark.usefixtures("answers_kept")

COLUMNS = ("--measured", "measured_mm", "--simulated", "simulated_mm")
QUICK = (*COLUMNS, "--no-held-out")


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plant, "RATE_HZ", 10.0)
        return record(Truth(expansion_um_k=1.5)).write(tmp_path_factory.mktemp("table") / "warm.csv")


@pytest.fixture(scope="module")
def short(warm):
    """Its first rows, for what a table is asked besides its findings."""
    path = warm.with_name("short.csv")
    path.write_text("\n".join(warm.read_text().splitlines()[:151]) + "\n")
    return path


def rows_of(text):
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


def test_a_person_reads_whether_where_and_what_form(run, warm):
    outcome = run("mismatch", warm, *QUICK)
    assert outcome.code == DONE
    assert "oil_temp_c  temperature  degC" in outcome.out
    assert "screw_deg   angle        deg" in outcome.out
    assert "There is a mismatch" in outcome.out
    assert "linear in oil_temp_c  identified" in outcome.out
    assert "slope 0.001" in outcome.out
    assert "Nothing is left beyond noise." in outcome.out


def test_the_answer_in_three_levels_comes_first(run, warm):
    outcome = run("mismatch", warm, *COLUMNS)
    first, second, third, fourth = outcome.out.splitlines()[:4]
    assert first.startswith("Measured and simulated values differ: probability 1.000, log density of held-out rows +")
    assert second.startswith("The difference follows oil_temp_c")
    assert third.startswith("  Correcting it leaves 0.00")
    assert fourth.startswith("  Law: ")
    levels = run("mismatch", warm, *COLUMNS, "--json").data["levels"]
    assert levels["differs"]["answer"] == "yes"
    assert levels["correction"] is True
    (one,) = levels["follows"]
    assert one["variables"] == [["oil_temp_c"]]
    assert one["after"] < one["before"]
    sizes = {each["follows"]: each["size"] for each in levels["differs"]["detectable"]}
    assert max(sizes.values()) < 0.005  # of noise of 2 µm


def test_a_size_that_matters_is_held_against_what_is_found(run, tmp_path):
    noise = 0.01 * np.random.default_rng(5).standard_normal(300)
    lines = [f"{k * 0.1:.1f},{m:.5f},0.0,{np.sin(k / 9.0):.5f}" for k, m in enumerate(noise)]
    path = tmp_path / "noise.csv"
    path.write_text("\n".join(["t_s,measured_mm,simulated_mm,place_mm", *lines]) + "\n")
    outcome = run("mismatch", path, *QUICK)
    assert outcome.out.startswith(
        f"No effect of {np.std(noise):.2g} mm rms or more is there: probability of any effect 0."
    )
    assert "Smallest effects that are found, rms: " in outcome.out
    outcome = run("mismatch", path, *QUICK, "--matters", "0.0001")
    assert outcome.out.startswith("Whether measured and simulated values differ cannot be told: an effect over ")
    outcome = run("mismatch", path, *QUICK, "--matters", "0")
    assert outcome.code == USAGE
    assert "0.0 is not in the range x>0.0" in outcome.err


def test_a_column_that_is_there_twice_is_taken_once(run, short, tmp_path):
    rows = [line.split(",") for line in short.read_text().splitlines() if not line.startswith("#")]
    again = rows[0].index("place_mm")
    path = tmp_path / "twice.csv"
    path.write_text("\n".join(",".join([*row, "again_mm" if row is rows[0] else row[again]]) for row in rows) + "\n")
    outcome = run("mismatch", path, *QUICK, "--json")
    assert "`again_mm` has the values of `place_mm` in all rows and is left out" in outcome.err
    assert "again_mm" not in {variable["name"] for variable in outcome.data["variables"]}


def test_what_rows_cannot_say_is_noted(run, tmp_path):
    """A column that is another but for its unit, one run only, and a clock that stands in every other row, or throughout."""
    place, noise = np.sin(np.arange(200) / 9.0), np.random.default_rng(3).standard_normal(200)
    head = "t_s,day,measured_mm,simulated_mm,place_mm,place_um,still_s"
    rows = [
        f"{k // 2},mon,{e:.5f},0.0,{x:.6f},{1e3 * x + 5.0:.3f},7"
        for k, (x, e) in enumerate(zip(place, noise, strict=True))
    ]
    path = tmp_path / "poor.csv"
    path.write_text("\n".join([head, *rows]) + "\n")
    outcome = run("mismatch", path, *QUICK, "--run", "day")
    assert (
        "`place_um` has the values of `place_mm` in all rows, but for scale and origin, and is left out" in outcome.err
    )
    assert "`t_s` stands still in 100 rows: delays, memories and integrals are not compared" in outcome.err
    assert "`day` has one run only: no other run tests what is found" in outcome.err
    outcome = run("mismatch", path, *QUICK, "--time", "still_s")
    assert (
        "`still_s` is the same in all rows: their order is unknown; give --time rows if they are in order"
        in outcome.err
    )
    assert "cannot be told: the order of the rows is unknown" in outcome.out


def test_a_program_reads_the_same_and_the_files_hold_it(run, warm, tmp_path):
    out, figure = tmp_path / "out.csv", tmp_path / "figure.svg"
    outcome = run("mismatch", warm, *QUICK, "--json", "--table", out, "--figure", figure)
    assert outcome.code == DONE
    data = outcome.data
    assert data["mismatch"] is True
    assert data["held_out_rms"] is None
    (finding,) = [f for f in data["findings"] if f["verdict"] == "identified"]
    assert (finding["form"], finding["variables"]) == ("linear", ["oil_temp_c"])
    slope = finding["values"]["slope"]
    assert slope["unit"] == "mm/degC"
    assert abs(slope["value"] - 1.5e-3) < 4.0 * slope["uncertainty"]
    written, given = rows_of(out.read_text()), rows_of(warm.read_text())
    assert [row["place_mm"] for row in written] == [row["place_mm"] for row in given]
    left = np.array([float(row["measured_mm"]) - float(row["corrected_mm"]) for row in written])
    assert np.allclose(left, [float(row["left_mm"]) for row in written], atol=1e-6)
    assert np.sqrt(np.mean(left**2)) == pytest.approx(data["residual_rms"]["after"], rel=1e-3)
    assert figure.read_bytes().count(b"<svg") == 1
    again = run("mismatch", warm, *QUICK, "--table", out)
    assert again.code == FAILED
    assert "--force" in again.err
    assert run("mismatch", warm, *QUICK, "--table", out, "--force").code == DONE


@pytest.fixture(scope="module")
def bent(tmp_path_factory):
    """Rows that no curve from one end foretells: a parabola, and a fall in the last tenth."""
    at, noise = np.linspace(0.0, 1.0, 200), np.random.default_rng(3).standard_normal(200)
    measured = 0.1 * np.where(at < 0.9, at**2, 0.81 - 18.0 * (at - 0.9)) + 0.01 * noise
    lines = [f"{m:.5f},0.0,{20.0 + 10.0 * x:.4f}" for m, x in zip(measured, at, strict=True)]
    path = tmp_path_factory.mktemp("table") / "bent.csv"
    path.write_text("\n".join(["measured_mm,simulated_mm,oil_temp_c", *lines]) + "\n")
    return path


def test_what_predicts_worse_than_the_simulation_is_said_first_and_no_correction_is_offered(run, bent, tmp_path):
    outcome = run("mismatch", bent, *COLUMNS, "--table", tmp_path / "corrected.csv")
    first, *others = outcome.out.splitlines()
    assert outcome.code == FAILED
    assert (
        "corrected.csv: not written. No correction is offered: the corrected values predict held-out rows"
        in outcome.err
    )
    assert not (tmp_path / "corrected.csv").exists()
    assert first.startswith("Held-out rows are predicted worse than as simulated: 0.0")
    assert first.endswith("mm rms as simulated.")
    assert not any(" identified " in line for line in others)
    assert "does-not-predict" in outcome.out
    data = run("mismatch", bent, *COLUMNS, "--json").data
    assert data["held_out"] == "tested"
    assert data["held_out_rms"]["worse"] is True
    assert data["held_out_rms"]["after"] > data["held_out_rms"]["as_simulated"]
    found = {f["name"]: f for f in data["findings"] if f["gains"]}
    assert found["curve over oil_temp_c"]["verdict"] == "does-not-predict"
    gains = found["curve over oil_temp_c"]["gains"]
    assert (len(gains["parts"]), gains["with_gain"]) == (10, sum(part > 0.0 for part in gains["parts"]))
    assert gains["total"] == pytest.approx(sum(gains["parts"]))


def test_what_was_not_tested_is_said(run, bent):
    outcome = run("mismatch", bent, *QUICK)
    assert "curve over oil_temp_c" in outcome.out
    assert "predictions of the identified causes were not tested" in outcome.out
    data = run("mismatch", bent, *QUICK, "--json").data
    assert data["held_out"] == "not-tested"
    assert all(finding["gains"] is None for finding in data["findings"])


def test_units_may_be_stated_and_variables_chosen(run, short, tmp_path):
    path = tmp_path / "bare.csv"
    path.write_text(short.read_text().replace("oil_temp_c", "oil").replace("screw_deg", "screw"))
    bare = run("mismatch", path, *QUICK, "--json").data
    kinds = {v["name"]: (v["kind"], v["unit"]) for v in bare["variables"]}
    assert kinds["screw"] == ("any", "")
    assert kinds["oil"] == ("any", "")
    stated = run("mismatch", path, *QUICK, "--variables", "screw=deg,oil=temperature", "--json").data
    kinds = {v["name"]: (v["kind"], v["unit"]) for v in stated["variables"]}
    assert kinds == {"screw": ("angle", "deg"), "oil": ("temperature", "")}
    assert stated["variables"][0]["period"] == 360.0


def test_physics_of_ones_own(run):
    folder = shipped_folder("fixtures")
    source = ("--source-files", folder / "sources" / "screw_expansion.py")
    data = run("mismatch", folder / "tables" / "axis.csv", *QUICK, *source, "--json").data
    (own,) = [f for f in data["findings"] if f["name"] == "screw-expansion"]
    assert own["verdict"] == "identified"
    alpha = own["values"]["alpha"]
    assert alpha["unit"] == "µm/(m K)"
    assert abs(alpha["value"] - 12.0) < 4.0 * alpha["uncertainty"]
    assert "The screw grows" in own["text"]


def test_physics_that_lacks_a_column_is_said(run, short, tmp_path):
    path = tmp_path / "bare.csv"
    path.write_text(short.read_text().replace("oil_temp_c", "oil"))
    source = shipped_folder("fixtures") / "sources" / "screw_expansion.py"
    outcome = run("mismatch", path, *QUICK, "--source-files", source, "--json")
    assert "screw-expansion cannot be asked: the table has no column oil_temp_c" in outcome.err
    assert "screw-expansion" in outcome.data["not_asked"]


def test_runs_are_told_apart_by_a_column(run, short, tmp_path):
    lines = short.read_text().splitlines()
    text = [f"{lines[0]},day", *(f"{line},{'mon' if k < 75 else 'tue'}" for k, line in enumerate(lines[1:]))]
    path = tmp_path / "days.csv"
    path.write_text("\n".join(text) + "\n")
    assert run("mismatch", path, *QUICK, "--run", "day", "--json").data["blocks"] == ["mon", "tue"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("--measured", "measured", "--simulated", "simulated_mm"),
            "x.csv:1: there is no column `measured`; did you mean",
        ),
        (("--measured", "measured_mm", "--simulated", "measured_mm"), "is named for measured and for simulated values"),
        (("--measured", "measured_mm", "--simulated", "other_um"), "cannot be compared; give both in the same unit"),
        ((*COLUMNS, "--variables", "palce_mm"), "there is no column `palce_mm`; did you mean `place_mm`?"),
        ((*COLUMNS, "--run", "day"), "there is no column `day`"),
        (COLUMNS, "x.csv:1: 4 rows with all values are too few to compare, 30 are needed"),
    ],
)
def test_bad_input_is_answered(run, tmp_path, arguments, said):
    path = tmp_path / "x.csv"
    path.write_text("measured_mm,simulated_mm,place_mm,other_um\n" + "1,2,3,4\n2,3,5,5\n3,4,4,4\n4,6,6,6\n")
    outcome = run("mismatch", path, *arguments)
    assert outcome.code == FAILED
    assert outcome.out == ""
    assert said in outcome.err


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (0.0, "is 0 mm in every row"),
        (0.25, "less `simulated_mm` is 0.25 mm in every row"),
        (None, "`measured_mm` is 3 mm in every row"),
    ],
)
def test_columns_that_differ_by_one_number_are_refused(run, tmp_path, more, told):
    """Rounding of a sum is no noise, and no effect; a stuck sensor measures nothing."""
    path, place = tmp_path / "x.csv", np.random.default_rng(7).uniform(-9.0, 9.0, 60)
    rows = "".join(f"{3.0 if more is None else one + more!r},{one!r},{k}\n" for k, one in enumerate(place.tolist()))
    path.write_text(f"measured_mm,simulated_mm,load_n\n{rows}")
    outcome = run("mismatch", path, *COLUMNS)
    assert outcome.code == FAILED
    assert told in outcome.err
    assert outcome.out == ""


def test_where_nothing_can_be_told_no_sentence_tells_it(run, tmp_path):
    """A slow wander of the reading: the first line, and what follows it."""
    path, draws = tmp_path / "x.csv", np.random.default_rng(5)
    walk = lfilter([1e-3], [1.0, -0.95], draws.normal(size=400))
    rows = "".join(
        f"{k},{one},0.0,{load}\n" for k, (one, load) in enumerate(zip(walk, draws.normal(size=400), strict=True))
    )
    path.write_text(f"t_s,measured_mm,simulated_mm,load_n\n{rows}")
    told = run("mismatch", path, *COLUMNS).out
    assert told.startswith("Whether measured and simulated values differ cannot be told")
    assert "o mismatch" not in told
    assert "is a mismatch" not in told


def test_an_unknown_unit_is_a_wrong_use(run, warm):
    outcome = run("mismatch", warm, *COLUMNS, "--variables", "place_mm=furlong")
    assert outcome.code == USAGE
    assert "--variables: `place_mm=furlong` is not understood" in outcome.err


def test_a_cell_that_is_no_number_is_named_with_its_line(run, short, tmp_path):
    lines = short.read_text().splitlines()
    cells = lines[10].split(",")
    lines[10] = ",".join([cells[0], "oops", *cells[2:]])
    path = tmp_path / "x.csv"
    path.write_text("\n".join(lines) + "\n")
    outcome = run("mismatch", path, *QUICK)
    assert outcome.code == FAILED
    assert "x.csv:11: measured_mm is `oops`, not a finite number" in outcome.err


def test_what_cannot_be_used_is_left_out_and_said(run, short, tmp_path):
    lines = short.read_text().splitlines()
    text = [f"{lines[0]},constant,word,copy"]
    for k, line in enumerate(lines[1:]):
        cells = line.split(",")
        cells[1] = "" if k == 5 else cells[1]
        text.append(",".join([*cells, "7", "abc", str(2.0 * float(cells[2]) + (float(cells[1]) if k != 5 else 0.0))]))
    path = tmp_path / "x.csv"
    path.write_text("\n".join(text) + "\n")
    outcome = run("mismatch", path, *QUICK, "--json")
    assert outcome.code == DONE
    assert "1 of 150 rows lack a number and are left out" in outcome.err
    assert "`constant` is the same in all rows and is left out" in outcome.err
    assert "`word` has no numbers and is left out" in outcome.err
    assert "`copy` is measured and simulated value over again, and is left out" in outcome.err
    assert {v["name"] for v in outcome.data["variables"]} == {"t_s", "place_mm", "screw_deg", "load_n", "oil_temp_c"}


def test_a_table_with_decimal_commas_says_the_same(run, short, tmp_path):
    german, out, plain = tmp_path / short.name, tmp_path / "out.csv", tmp_path / "plain.csv"
    german.write_text(short.read_text().replace(",", ";").replace(".", ","))
    told = run("mismatch", german, *QUICK, "--decimal", ",", "--table", out, "--json").data
    expected = run("mismatch", short, *QUICK, "--table", plain, "--json").data
    assert told["findings"] == expected["findings"]
    assert out.read_text() == plain.read_text()
    outcome = run("mismatch", german, *QUICK)
    assert outcome.code == FAILED
    assert "has decimal commas" in outcome.err


def test_the_table_says_where_it_comes_from(run, short, tmp_path):
    out = tmp_path / "out.csv"
    table = shutil.copy(short, tmp_path / "another.csv")  # no command has read it
    assert run("mismatch", table, *QUICK, "--table", out).code == DONE
    told = json.loads((tmp_path / "out.csv.provenance.json").read_text())
    assert list(told["inputs"].values()) == [hashlib.sha256(short.read_bytes()).hexdigest()]
    assert told["command"].startswith("dbbstation mismatch")


def test_dates_are_a_clock_and_a_column_in_proportion_to_the_simulation_stays(run, tmp_path):
    """Friction over a speed: simulated is viscous, so that the speed is that value but for scale."""
    rng = np.random.default_rng(7)
    speed = np.sin(np.arange(240) / 11.0) + 0.4 * np.sin(np.arange(240) / 4.3)
    measured = 0.5 * speed + 0.3 * np.sign(speed) + 0.7 + 0.03 * rng.standard_normal(240)
    lines = [
        f"2026-03-01T08:{k // 60:02d}:{k % 60:02d}Z,{m:.5f},{0.5 * v:.6f},{v:.6f}"
        for k, (m, v) in enumerate(zip(measured, speed, strict=True))
    ]
    path, other, out = tmp_path / "friction.csv", tmp_path / "other.csv", tmp_path / "out.csv"
    head = "logged,torque_n_m,viscous_n_m,speed_rad_s"
    path.write_text("\n".join([head, *lines[:160]]) + "\n")
    # Other rows have no measured values.
    rest = [",".join(cell for k, cell in enumerate(line.split(",")) if k != 1) for line in (head, *lines[160:])]
    other.write_text("\n".join(rest) + "\n")
    asked = ("--measured", "torque_n_m", "--simulated", "viscous_n_m", "--no-held-out")
    outcome = run("mismatch", path, *asked, "--apply", other, "--table", out)
    assert outcome.code == DONE
    assert "On average they differ by 0.7" in outcome.out.splitlines()[0]
    assert "saturation of speed_rad_s" in outcome.out
    assert "logged" not in outcome.err
    data = run("mismatch", path, *asked, "--json").data
    assert next((v["name"], v["kind"], v["unit"]) for v in data["variables"]) == ("logged", "time", "s")
    written = rows_of(out.read_text())
    assert list(written[0]) == [*rest[0].split(","), "corrected_n_m", "u_corrected_n_m"]
    corrected, u = (np.array([float(row[name]) for row in written]) for name in ("corrected_n_m", "u_corrected_n_m"))
    off = corrected - 0.7 - 0.5 * speed[160:] - 0.3 * np.sign(speed[160:])
    away = np.abs(speed[160:]) > 0.2
    assert np.sqrt(np.mean(np.square(off / u)[away])) < 2.5
    assert np.abs(off[away]).max() < 0.05
