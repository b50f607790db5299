"""Motor currents beside circles: loads, drives and centre of gravity of independent simulations are found again."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import lfilter
from scipy.stats import chi2

from dbbstation.calibration.fit.calibrate import MEASUREMENT_SOURCES, calibrate
from dbbstation.calibration.reporting.evaluation import evaluate
from dbbstation.calibration.reporting.figures import calibration_figures
from dbbstation.cli import cli
from dbbstation.errors import CalibrationError, ModelError
from dbbstation.facts.serialise import plain
from dbbstation.files.formats.model import read_model
from dbbstation.machine.geometry import StrutMasses
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.tasks.load import load_sessions
from dbbstation.trace.columns import currents
from tests.once import computed_once
from tests.plant.mechanisms.currents import DriveCurrents
from tests.plant.mechanisms.gravity import CentreOfGravityShift, Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.weights import StrutWeight
from tests.plant.plan import EIGHT, subset, table_ii_plan
from tests.plant.session import record

NAMES = ("strut-reference-length", "base-joints", "gravity", "cog-shift", "drive-friction")
SHIFT_MM = (3.0, -5.0, 12.0)
GAIN_N_A = (400.0, 310.0, 395.0, 505.0, 398.0, 402.0)
COULOMB_N = (120.0, 130.0, 60.0, 125.0, 240.0, 115.0)
DRIVES = DriveCurrents(gain_n_a=GAIN_N_A, coulomb_n=COULOMB_N, moving_kg=0.0)


def sources(names=NAMES):
    return sources_named(names + MEASUREMENT_SOURCES)


def session(folder, seed, *, drives=DRIVES, weights=(), tests="", rate_hz=20.0):
    plan = table_ii_plan(seed)
    mechanisms = [RandomKinematics(0.03, 0.05), Gravity(), CentreOfGravityShift(SHIFT_MM), *weights, drives]
    record(folder, seed=seed, plan=subset(plan, tests) if tests else plan, mechanisms=mechanisms, rate_hz=rate_hz)
    return load_sessions([folder])


def true_values(drives=DRIVES):
    found = {f"{axis}_mm": value for axis, value in zip("xyz", SHIFT_MM, strict=True)}
    for motor in range(6):
        kinds = {
            "gain_a_kn": 1000.0 / drives.gain_n_a[motor],
            "coulomb_n": drives.coulomb_n[motor],
            "viscous_ns_mm": drives.viscous_n_s_mm,
            "load_share_n_kn": 1000.0 * drives.load_share,
            "asymmetry_n": 0.0,
        }
        found |= {f"motor_{motor + 1}_{kind}": value for kind, value in kinds.items()}
    return found


def numbers(calibration, of=("cog-shift", "drive-friction")):
    columns = [k for k, name in enumerate(calibration.layout.names) if name[0] in of]
    names = [calibration.layout.names[k][2] for k in columns]
    return names, calibration.x[columns], calibration.solution.covariance[np.ix_(columns, columns)]


def value(calibration, name):
    names, values, covariance = numbers(calibration, ("gravity", "cog-shift", "drive-friction"))
    return values[names.index(name)], np.sqrt(covariance[names.index(name), names.index(name)])


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plant") / "small"
    return folder, session(folder, 21, tests="abcde", rate_hz=5.0)


@pytest.fixture(scope="module")
def fitted(small):
    _, recorded = small
    return calibrate(recorded.machine, recorded.observations, sources())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "tests", "known_mm"),
    [(31, EIGHT, 10.0), *(pytest.param(seed, "", 5.0, marks=pytest.mark.nightly) for seed in (31, 32, 33))],
)
def test_centre_of_gravity_gains_and_friction_are_found(tmp_path, seed, tests, known_mm):
    recorded = session(tmp_path / "s", seed, tests=tests)
    calibration = calibrate(recorded.machine, recorded.observations, sources())
    names, values, covariance = numbers(calibration)
    error = values - np.array([true_values()[name] for name in names])
    statistic = error @ np.linalg.solve(covariance, error)
    assert chi2.ppf(1e-4, len(error)) < statistic < chi2.ppf(1 - 1e-4, len(error))
    # The weight sits in the product with the compliance; gravity takes tensions at the commanded pose, where they are
    # parts in a thousand off.
    assert value(calibration, "strut_compliance_um_kn")[0] == pytest.approx(9.68, rel=0.01)
    # 20 mA white, rounded to 1 mA.
    assert np.allclose([noise.sigma for noise in calibration.currents.noise], 0.020, rtol=0.05)
    assert np.allclose(calibration.currents.residual_a, calibration.currents.fine_a, rtol=0.05)
    assert not calibration.currents.notes
    for axis in "xyz":
        circles, currents = (calibration.currents.alone[channel][f"{axis}_mm"] for channel in ("circles", "currents"))
        both = value(calibration, f"{axis}_mm")
        assert both[1] <= min(circles[1], currents[1])
        # To a few mm from circles, to hundredths from currents.
        assert 0.3 < circles[1] < known_mm
        assert currents[1] < 0.05
        assert abs(circles[0] - dict(zip("xyz", SHIFT_MM, strict=True))[axis]) < 1.6 * known_mm


@pytest.mark.nightly  # struts that weigh nothing are in CI
def test_struts_that_weigh_something_are_taken_from_the_machine_file(tmp_path):
    """Telescopes of 30 kg, of which the motor moves half, and motors of 20 kg behind the joint."""
    drives = replace(DRIVES, moving_kg=15.0)
    recorded = session(tmp_path / "s", 41, drives=drives, weights=[StrutWeight(30.0, 20.0, 300.0)])
    known = replace(recorded.machine, strut_masses=StrutMasses(30.0, 20.0, 300.0))
    calibration = calibrate(known, recorded.observations, sources())
    names, values, covariance = numbers(calibration)
    error = values - np.array([true_values(drives)[name] for name in names])
    statistic = error @ np.linalg.solve(covariance, error)
    assert chi2.ppf(1e-4, len(error)) < statistic < chi2.ppf(1 - 1e-4, len(error))
    # A file that does not know of them is found out.
    unknown = calibrate(recorded.machine, recorded.observations, sources())
    assert any("leave something slow beside noise" in note for note in unknown.currents.notes)
    assert min(unknown.currents.residual_a) > 1.2 * max(unknown.currents.fine_a)


def test_a_wrong_weight_is_in_gains_and_compliance_and_nowhere_else(small, fitted):
    _, recorded = small
    masses = recorded.machine.masses
    heavier = replace(recorded.machine, masses=replace(masses, platform_kg=1.02 * masses.platform_kg))
    calibration = calibrate(heavier, recorded.observations, sources())
    for motor in range(1, 7):
        gain, shared = f"motor_{motor}_gain_a_kn", f"motor_{motor}_load_share_n_kn"
        assert value(calibration, gain)[0] == pytest.approx(value(fitted, gain)[0] / 1.02, rel=1e-4)
        assert value(calibration, shared)[0] == pytest.approx(value(fitted, shared)[0], abs=0.02)
        coulomb = f"motor_{motor}_coulomb_n"
        assert value(calibration, coulomb)[0] == pytest.approx(1.02 * value(fitted, coulomb)[0], rel=1e-3)
    compliance = "strut_compliance_um_kn"
    assert value(calibration, compliance)[0] == pytest.approx(value(fitted, compliance)[0] / 1.02, rel=1e-3)
    for axis in "xyz":
        assert value(calibration, f"{axis}_mm")[0] == pytest.approx(value(fitted, f"{axis}_mm")[0], abs=2e-3)


def test_without_drive_friction_currents_change_nothing(small):
    _, recorded = small
    bare = [replace(o, raw=replace(o.raw, logged={})) for o in recorded.observations]
    names = sources(NAMES[:-1])
    with_currents = calibrate(recorded.machine, recorded.observations, names)
    assert with_currents.currents is None
    assert np.array_equal(with_currents.x, calibrate(recorded.machine, bare, names).x)
    assert "motor_currents" not in plain(
        calibration_figures(with_currents, evaluate(with_currents.model, recorded.observations))
    )


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [125.0, pytest.param(250.0, marks=pytest.mark.nightly)])
def test_long_runs_say_as_much_as_their_means(tmp_path, fitted, rate_hz):
    recorded = session(tmp_path / "s", 21, tests="ab", rate_hz=rate_hz)
    more = session(tmp_path / "t", 21, tests="cde", rate_hz=5.0)
    calibration = calibrate(recorded.machine, recorded.observations + more.observations, sources())
    names, values, covariance = numbers(calibration, ("cog-shift",))
    error = values - np.array([true_values()[name] for name in names])
    assert error @ np.linalg.solve(covariance, error) < chi2.ppf(1 - 1e-4, 3)
    assert value(calibration, "motor_1_gain_a_kn")[1] < value(fitted, "motor_1_gain_a_kn")[1]


def spoilt(recorded, change):
    return tuple(
        replace(o, raw=replace(o.raw, logged=currents(change(k, o.raw.motor_current_a.copy()))))
        for k, o in enumerate(recorded.observations)
    )


def column_set(motor, entry):
    def change(_, current):
        current[:, motor - 1] = entry
        return current

    return change


@pytest.mark.parametrize(
    ("change", "motor", "said"),
    [
        (column_set(4, 0.0), 4, "motor 4: its current stands still at 0 A throughout, a channel that is dead"),
        pytest.param(column_set(6, np.nan), 6, "motor 6: its current was not logged", marks=pytest.mark.nightly),
    ],
    ids=["dead", "not-logged"],
)
def test_one_motor_without_a_current_leaves_five_that_count(small, change, motor, said):
    _, recorded = small
    calibration = calibrate(recorded.machine, spoilt(recorded, change), sources())
    assert any(said in note and "other motors count" in note for note in calibration.currents.notes)
    assert {name for name in calibration.currents.held if name.startswith(f"motor_{motor}_")} == {
        f"motor_{motor}_{kind}"
        for kind in ("gain_a_kn", "coulomb_n", "viscous_ns_mm", "load_share_n_kn", "asymmetry_n")
    }
    assert calibration.currents.noise[motor - 1] is None
    # What is open of a drive is no direction in which the tool could be off.
    assert not any("drive-friction" in text for text in calibration.directions_lost)
    figures = calibration_figures(calibration, evaluate(calibration.model, recorded.observations))
    summary = plain(figures)["motor_currents"]
    assert summary["motors"][motor - 1]["gain_a_kn"] is None
    json.dumps(summary, allow_nan=False)
    z_mm, u_mm = value(calibration, "z_mm")
    assert abs(z_mm - SHIFT_MM[2]) < 5 * u_mm
    assert u_mm < 0.2


def test_a_saturated_channel_is_noticed_and_its_limit_left_out(small):
    _, recorded = small
    limit = np.quantile(np.concatenate([o.raw.motor_current_a[:, 1] for o in recorded.observations]), 0.9)

    def clipped(_, current):
        return np.minimum(current, [np.inf, limit, np.inf, np.inf, np.inf, np.inf])

    calibration = calibrate(recorded.machine, spoilt(recorded, clipped), sources())
    (note,) = [note for note in calibration.currents.notes if "saturates" in note]
    assert note.startswith(f"motor 2: its current stops at {limit:g} A, in 10.")
    gain, uncertainty = value(calibration, "motor_2_gain_a_kn")
    assert abs(gain - 1000.0 / GAIN_N_A[1]) < 5 * uncertainty


def test_a_strut_that_never_turns_round_leaves_friction_and_asymmetry_as_one(small):
    """All readings of motor 3 taken while its strut shrinks are thrown away."""
    _, recorded = small

    def growing_only(k, current):
        motion = recorded.observations[k].motion()
        length = np.linalg.norm(_strut(recorded.machine, motion.poses, 2), axis=1)
        current[np.diff(length, prepend=length[0])[motion.kept] < 0.0, 2] = np.nan
        return current

    calibration = calibrate(recorded.machine, spoilt(recorded, growing_only), sources())
    (note,) = [note for note in calibration.currents.notes if "only grows" in note]
    assert note.startswith("motor 3: its strut only grows in these recordings")
    assert {"motor_3_coulomb_n", "motor_3_asymmetry_n"} <= calibration.currents.held
    # Their sum is what such readings know; the direction held is scale by scale, 100 against 50 N.
    total = value(calibration, "motor_3_coulomb_n")[0] + value(calibration, "motor_3_asymmetry_n")[0]
    assert total == pytest.approx(COULOMB_N[2], abs=5.0)
    assert "motor_2_coulomb_n" not in calibration.currents.held


def _strut(machine, poses, strut):
    a, b = np.radians(poses[:, 3]), np.radians(poses[:, 4])
    x, y, z = machine.hexapod.platform_joints_mm[strut]
    # Rx(A) Ry(B)
    turned = np.column_stack([np.cos(b) * x + np.sin(b) * z, np.full_like(a, y), -np.sin(b) * x + np.cos(b) * z])
    turned = np.column_stack(
        [
            turned[:, 0],
            np.cos(a) * turned[:, 1] - np.sin(a) * turned[:, 2],
            np.sin(a) * turned[:, 1] + np.cos(a) * turned[:, 2],
        ]
    )
    return poses[:, :3] + turned - machine.hexapod.base_joints_mm[strut]


def test_currents_with_the_other_sign_are_doubted(small):
    _, recorded = small
    calibration = calibrate(recorded.machine, spoilt(recorded, lambda _, current: -current), sources())
    assert sum("is its sign turned round?" in note for note in calibration.currents.notes) == 6


def test_noise_that_remembers_counts_for_less(small, fitted, rng):
    """A first-order process of 0.9 from sample to sample on motor 1: one independent reading in nineteen."""
    _, recorded = small

    def disturbed(_, current):
        pushes = rng.standard_normal(len(current)) * 0.1 * np.sqrt(1 - 0.9**2)
        current[:, 0] += lfilter([1.0], [1.0, -0.9], pushes)
        return current

    calibration = calibrate(recorded.machine, spoilt(recorded, disturbed), sources())
    noise = calibration.currents.noise
    assert noise[0].sigma == pytest.approx(0.1, rel=0.15)
    # (1 + 0.9) / (1 - 0.9), less the white 20 mA and what is left out about reversals.
    assert 10.0 < noise[0].correlation_samples < 25.0
    assert all(other.correlation_samples < 2.0 for other in noise[1:])
    gain, uncertainty = value(calibration, "motor_1_gain_a_kn")
    assert abs(gain - 1000.0 / GAIN_N_A[0]) < 5 * uncertainty
    assert uncertainty > 10 * value(fitted, "motor_1_gain_a_kn")[1]


def test_some_runs_without_currents_count_with_their_circles(small):
    _, recorded = small
    partly = [replace(o, raw=replace(o.raw, logged={})) if o.test == "e" else o for o in recorded.observations]
    calibration = calibrate(recorded.machine, partly, sources())
    assert "2 of 10 runs have no motor currents: their circles count alone" in calibration.currents.notes
    assert len(calibration.residual_mm) == 10


def test_no_currents_and_no_masses_are_refused_by_name(small):
    _, recorded = small
    none = [replace(o, raw=replace(o.raw, logged={})) for o in recorded.observations]
    with pytest.raises(ModelError, match="drive-friction needs current, which is not given here"):
        calibrate(recorded.machine, none, sources())
    with pytest.raises(CalibrationError, match=r"no motor has a usable current: motor 1: .* stands still"):
        calibrate(recorded.machine, spoilt(recorded, lambda _, current: 0.0 * current), sources())
    bare = replace(recorded.machine, masses=None)
    with pytest.raises(ModelError, match=r"drive-friction needs .* has no `masses`"):
        calibrate(bare, recorded.observations, sources(("strut-reference-length", "drive-friction")))


def test_the_command_prints_drives_and_centre_of_gravity(small, tmp_path, tmp_path_factory, monkeypatch):
    computed_once(tmp_path_factory, monkeypatch, "dbbstation.tasks.calibrate.calibrate")  # printed, and as JSON
    folder, _ = small
    arguments = ["calibrate", str(folder), "--sources", ",".join(NAMES), "--out", str(tmp_path / "model.yaml")]
    said = CliRunner().invoke(cli, arguments)
    assert said.exit_code == 0, said.output
    assert "motor currents, with the platform's weight of 3924 N taken as known" in said.stdout
    assert "centre of gravity, actual minus machine file, platform axes [mm]" in said.stdout
    assert "circles alone" in said.stdout
    assert "Nm/A" in said.stdout
    kept = read_model(tmp_path / "model.yaml", known_sources())
    assert "drive-friction" in {f.source.name for f in kept.model.sources}
    answer = CliRunner().invoke(cli, [*arguments[:-2], "--json"])
    found = json.loads(answer.stdout)["motor_currents"]
    for motor, gain in zip(found["motors"], GAIN_N_A, strict=True):
        assert motor["force_per_current"]["value"] == pytest.approx(gain, rel=2e-3)
        # A screw of 10 mm lead.
        torque = motor["torque_per_current"]["value"]
        assert torque == pytest.approx(motor["force_per_current"]["value"] * 0.010 / (2 * np.pi), rel=1e-12)
        assert motor["noise_a"] == pytest.approx(0.02, rel=0.1)
    z = found["centre_of_gravity"]["z_mm"]
    assert z["circles"] is None  # five circles by themselves do not see it
    assert z["both"]["uncertainty"] <= z["currents"]["uncertainty"] < 0.1
    assert z["both"]["value"] == pytest.approx(12.0, abs=5 * z["both"]["uncertainty"])
