"""Loads, currents and the one compliance of a model, against finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.calibration.currents import motor_currents
from dbbstation.machine.geometry import Compliance, StrutMasses
from dbbstation.model.compensation import compensated
from dbbstation.model.identified import IdentifiedModel, position_uncertainty_mm
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Effect, Fitted, LinearSource, Motion, Need, Owner, Parameter, Texts
from dbbstation.sources.registry import sources_named
from dbbstation.trace.columns import currents
from tests.sources.runs import random_machine, random_run, run

NAMES = ("gravity", "cog-shift", "strut-weight", "drive-friction")
DRIVE = np.tile([2.5, 120.0, 2.0, 60.0, 5.0], 6)


@pytest.fixture
def machine(reference, rng):
    return random_machine(reference, reference.hexapod.rotation, rng)


def model_of(machine, values=None):
    gravity, cog, struts, drives = sources_named(NAMES)
    values = values or {}
    usual = {
        "gravity": np.array([9.0]),
        "cog-shift": np.array([4.0, -7.0, 15.0]),
        "strut-weight": np.array([22.0, 18.0, 9.0]),
        "drive-friction": DRIVE,
    }
    return MachineModel(
        machine, tuple(Fitted(s, values.get(s.name, usual[s.name])) for s in (gravity, cog, struts, drives))
    )


def by_differences(machine, name, k, of, step):
    usual = {f.source.name: f.values for f in model_of(machine).sources}
    ends = []
    for sign in (1, -1):
        values = usual[name].copy()
        values[k] += sign * step
        ends.append(of(model_of(machine, {name: values})))
    return (ends[0] - ends[1]) / (2 * step)


@pytest.mark.parametrize(("name", "step"), [("cog-shift", 1e-2), ("strut-weight", 1e-2), ("drive-friction", 1e-3)])
def test_currents_answer_to_weights_and_drives(machine, rng, name, step):
    motion = random_run(rng, 80)
    model = model_of(machine)
    fitted = next(f for f in model.sources if f.source.name == name)
    exact = motor_currents(model, motion).by_parameters(fitted)
    for k in range(min(len(fitted.values), 10)):
        numeric = by_differences(machine, name, k, lambda m: motor_currents(m, motion).current_a, step)
        # A weight moves the machine a little too, which changes loads by parts in a thousand.
        scale = np.abs(exact[:, :, k]).max()
        assert np.median(np.abs(numeric - exact[:, :, k])) < 2e-3 * scale
        assert np.quantile(np.abs(numeric - exact[:, :, k]), 0.95) < 1e-2 * scale


class Offset(LinearSource):
    """Amplifiers that read a current which is none."""

    name = "offset"
    belongs_to = Owner.MACHINE
    needs = frozenset({Need.CURRENT})
    texts = Texts("", "", "", "", "", "")

    def parameters(self, machine):  # noqa: ARG002
        return (Parameter("offset_a", "A", 0.1, ""),)

    def derivative(self, motion, machine, values):  # noqa: ARG002
        return Effect(current_a=np.ones((len(motion), 6, 1)))


def test_currents_that_no_load_changes_answer_to_no_weight(machine, rng):
    motion = random_run(rng, 80)
    weight = Fitted(sources_named(["cog-shift"])[0], np.array([4.0, -7.0, 15.0]))
    currents_of = motor_currents(MachineModel(machine, (weight, Fitted(Offset(), np.array([0.2])))), motion)
    np.testing.assert_array_equal(np.unique(currents_of.current_a), [0.2])
    np.testing.assert_array_equal(currents_of.by_parameters(weight), np.zeros((*currents_of.current_a.shape, 3)))


@pytest.mark.parametrize(("name", "step"), [("gravity", 1e-3), ("cog-shift", 1e-2), ("strut-weight", 1e-2)])
def test_struts_have_one_compliance_for_all_weights(machine, rng, name, step):
    motion = random_run(rng, 80)
    model = model_of(machine)
    fitted = next(f for f in model.sources if f.source.name == name)
    there = model.actual(motion)
    exact = there.derivative(fitted).strut_mm
    for k in range(len(fitted.values)):
        numeric = by_differences(machine, name, k, lambda m: m.effect(motion, there).strut_mm, step)
        assert np.allclose(exact[:, :, k], numeric, rtol=1e-6, atol=1e-9 * np.abs(exact).max())


def test_without_a_compliance_found_the_machine_files_counts(machine, rng):
    motion = random_run(rng, 40)
    cog = sources_named(["cog-shift"])[0]
    shift = np.array([1.0, 2.0, 3.0])
    alone = MachineModel(machine, (Fitted(cog, shift),)).effect(motion).strut_mm
    assert np.array_equal(alone, cog.effect(motion, machine, shift).strut_mm)
    twice = replace(machine, compliance=replace(machine.compliance, at_1000mm_mm_per_n=2e-5))
    stiff = replace(machine, compliance=replace(machine.compliance, at_1000mm_mm_per_n=1e-5))
    loads = [MachineModel(m, (Fitted(cog, shift),)).effect(motion) for m in (stiff, twice)]
    assert np.allclose(2 * loads[0].strut_mm, loads[1].strut_mm)
    assert np.array_equal(loads[0].load_n, loads[1].load_n)


def test_strut_weights_of_a_source_replace_those_of_the_machine_file(machine, rng):
    motion = random_run(rng, 40)
    struts, drives = sources_named(["strut-weight", "drive-friction"])
    stated = machine.strut_masses
    values = np.array([stated.strut_kg, stated.motor_kg, stated.screw_kg])
    by_file = motor_currents(MachineModel(machine, (Fitted(drives, DRIVE),)), motion).current_a
    by_source = MachineModel(machine, (Fitted(struts, values), Fitted(drives, DRIVE)))
    # The struts stretch under their weight there, which moves the platform by some tens of µm.
    assert np.allclose(motor_currents(by_source, motion).current_a, by_file, rtol=1e-3, atol=2e-3)
    bare = replace(machine, strut_masses=None)
    without = motor_currents(MachineModel(bare, (Fitted(drives, DRIVE),)), motion).current_a
    assert np.abs(without - by_file).max() > 0.1


def test_loads_are_those_where_the_machine_really_is(reference):
    """A platform that stands 2 mm to the side carries itself otherwise than the commanded pose says."""
    motion = run((100, 0, -1008), (0, 15))
    motion = replace(motion, logged=currents(np.zeros((len(motion), 6))))
    drives, joints = sources_named(["drive-friction", "base-joints"])
    shifted = np.tile([2.0, 0.0, 0.0], 6)
    there = MachineModel(reference, (Fitted(drives, DRIVE), Fitted(joints, shifted)))
    # All base joints together: the platform goes with them, and nothing changes for the struts.
    same = MachineModel(reference, (Fitted(drives, DRIVE),))
    assert np.allclose(motor_currents(there, motion).current_a, motor_currents(same, motion).current_a, atol=1e-9)
    one = np.zeros(18)
    one[0] = 2.0
    other = MachineModel(reference, (Fitted(drives, DRIVE), Fitted(joints, one)))
    assert np.abs(motor_currents(other, motion).current_a - motor_currents(same, motion).current_a).max() > 0.005


def test_poses_and_programs_do_without_currents(reference):
    gravity, drives = sources_named(["gravity", "drive-friction"])
    plain = MachineModel(reference, (Fitted(gravity, np.array([9.68])),))
    knowing = MachineModel(reference, (*plain.sources, Fitted(drives, DRIVE)))
    motion = Motion(np.array([[0.0, 50.0, -1000.0, 10.0, 0.0, 0.0], [20.0, 0.0, -1050.0, 0.0, 5.0, 0.0]]))
    assert np.array_equal(plain.actual_poses(motion), knowing.actual_poses(motion))
    assert np.array_equal(compensated(plain, motion), compensated(knowing, motion))
    rows = (("gravity", "", "strut_compliance_um_kn"), ("drive-friction", "", "motor_1_coulomb_n"))
    known = IdentifiedModel(knowing, rows, np.diag([1e-4, 1.0]))
    bare = IdentifiedModel(plain, rows[:1], np.diag([1e-4]))
    assert np.array_equal(position_uncertainty_mm(known, motion), position_uncertainty_mm(bare, motion))


def test_a_weightless_strut_adds_no_load(reference):
    motion = replace(run((0, 0, -1008), (5, 5)), logged=currents(np.zeros((202, 6))))
    drives = sources_named(["drive-friction"])[0]
    bare = MachineModel(replace(reference, compliance=Compliance(1e-5)), (Fitted(drives, DRIVE),))
    light = MachineModel(replace(reference, strut_masses=StrutMasses(0.0, 0.0, 0.0)), (Fitted(drives, DRIVE),))
    assert np.allclose(motor_currents(bare, motion).current_a, motor_currents(light, motion).current_a)
