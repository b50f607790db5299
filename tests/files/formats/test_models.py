"""Models survive writing and reading to the last bit; one that was tampered with is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbbstation.errors import InputError, ModelError, OutputError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.model import covariance_fault, read_model, write_model
from dbbstation.files.own_sources import every_source
from dbbstation.files.places import shipped_folder
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Effect, ErrorSource, Fitted, Owner, Parameter
from dbbstation.sources.registry import known_sources

SMALL = shipped_folder("fixtures") / "models" / "small.yaml"
EXAMPLE = shipped_folder("fixtures") / "sources" / "scale_bow.py"


class Struts(ErrorSource):
    name = "struts"
    belongs_to = Owner.MACHINE

    def parameters(self, machine):  # noqa: ARG002
        return tuple(Parameter(f"strut_{i}_mm", "mm", 0.1, "actual minus believed") for i in (1, 2))

    def effect(self, motion, machine, values):  # noqa: ARG002
        return Effect()

    derivative = effect


class Seat(Struts):
    name = "seat"
    belongs_to = Owner.MOUNTING


class Heavy(Struts):
    name = "heavy"

    def parameters(self, machine):  # noqa: ARG002
        raise ModelError("heavy needs masses", remedy="give them in the machine file")


KNOWN = {source.name: source for source in (Struts(), Seat(), Heavy())}


def drawn(reference, seed: int) -> IdentifiedModel:
    rng = np.random.default_rng(seed)
    fitted = (
        Fitted(KNOWN["struts"], rng.normal(size=2)),
        Fitted(KNOWN["seat"], rng.normal(size=2) * 1e-3, "small: ball, mounting 1"),
        Fitted(KNOWN["seat"], rng.normal(size=2) * 1e-3, "small: ball, mounting 2"),
    )
    rows = tuple((one.source.name, one.shared, p.name) for one in fitted for p in one.source.parameters(reference))
    root = rng.normal(size=(6, 6)) * 10.0 ** rng.uniform(-6, 0, 6)[:, None]
    root[1] = 0.0
    report = {
        "rms_um": 0.5,
        "count": 24,
        "ok": True,
        "none": None,
        "rows": [[1, 2.5], []],
        "text": "a: b",
        "by": {"x": 1e-9},
    }
    sessions = {"2026-11-20": "ab" * 32}
    unseen, of_formulas = rng.normal(size=(2, 6)), rng.uniform(size=6)
    return IdentifiedModel(
        MachineModel(reference, fitted),
        rows,
        root @ root.T,
        ("all six, along Z",),
        report,
        sessions,
        unseen,
        of_formulas,
    )


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_model_survives_to_the_last_bit(tmp_path_factory, reference, seed) -> None:
    path = tmp_path_factory.mktemp("model") / "model.yaml"
    model = drawn(reference, seed)
    write_model(path, model)
    read = read_model(path, KNOWN)
    assert np.array_equal(read.covariance, model.covariance)
    assert (read.covariance_rows, read.directions_lost) == (model.covariance_rows, model.directions_lost)
    assert np.array_equal(read.null_space, model.null_space)
    assert np.array_equal(read.formula_variance, model.formula_variance)
    assert (read.report, read.sessions) == (model.report, model.sessions)
    assert len(read.model.sources) == 3
    for a, b in zip(read.model.sources, model.model.sources, strict=True):
        assert (a.source, a.shared) == (b.source, b.shared)
        assert np.array_equal(a.values, b.values)
    assert np.array_equal(read.model.machine.hexapod.base_joints_mm, reference.hexapod.base_joints_mm)
    assert len(read.model.of_the_machine().sources) == 1


@pytest.mark.parametrize("source", known_sources().values(), ids=lambda source: source.name)
def test_every_source_survives_in_a_model(tmp_path: Path, source) -> None:
    machine = read_machine(shipped_folder("fixtures") / "machines" / "every-key.yaml")
    parameters = source.parameters(machine)
    values = np.random.default_rng(5).normal(size=len(parameters))
    shared = "" if source.belongs_to is Owner.MACHINE else "2026-11-20: one, mounting 1"
    path = tmp_path / "model.yaml"
    rows = tuple((source.name, shared, parameter.name) for parameter in parameters)
    model = MachineModel(machine, (Fitted(source, values, shared),))
    write_model(path, IdentifiedModel(model, rows, np.eye(len(rows))))
    (read,) = read_model(path, known_sources()).model.sources
    assert (read.source, read.shared) == (source, shared)
    assert np.array_equal(read.values, values)


def test_a_parameter_that_a_source_had_not_yet_is_zero(tmp_path: Path, reference) -> None:
    source = known_sources()["thermal-struts"]
    rows = tuple((source.name, "", name) for name in ("growth_um_m", "time_constant_s", "pause_loss_um_m"))
    path = tmp_path / "model.yaml"
    fitted = Fitted(source, np.array([21.5, 3000.0, 4.0]))
    write_model(path, IdentifiedModel(MachineModel(reference, (fitted,)), rows[:2], np.eye(2)))
    text = path.read_text()
    lacking, count = re.subn(r",\s*pause_loss_um_m: \{[^}]*\}", "", text)
    assert count == 1
    path.write_text(lacking)
    (read,) = read_model(path, known_sources()).model.sources
    assert np.array_equal(read.values, [21.5, 3000.0, 0.0])
    path.write_text(text.replace("time_constant_s", "time_constant_x"))
    with pytest.raises(InputError, match="`time_constant_s` of thermal-struts is missing"):
        read_model(path, known_sources())


def test_writing_twice_needs_force(tmp_path: Path, reference) -> None:
    path = tmp_path / "model.yaml"
    write_model(path, drawn(reference, 1))
    with pytest.raises(OutputError, match="exists already"):
        write_model(path, drawn(reference, 2))
    before = path.read_text()
    write_model(path, drawn(reference, 2), force=True)
    assert path.read_text() != before


def test_a_model_that_could_not_be_read_back_is_not_written(tmp_path: Path, reference) -> None:
    model = drawn(reference, 1)
    for covariance in (-np.eye(6), np.eye(5)):
        broken = IdentifiedModel(model.model, model.covariance_rows, covariance)
        with pytest.raises(ValueError, match="cannot be written"):
            write_model(tmp_path / "model.yaml", broken)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("name: struts", "name: strats", "no error source is called `strats`; did you mean struts?"),
        ("name: struts", "name: heavy", "heavy needs masses; give them in the machine file"),
        ("name: struts", "name: seat", "`seat` belongs to the mounting, not here; put it under `measurement_effects`"),
        ("name: seat", "name: struts", "`struts` belongs to the machine, not here; put it under `sources`"),
        ("mounting 2", "mounting 1", "`seat` stands here a second time; remove one"),
        ("unit: mm", "unit: um", "struts strut_1_mm is in mm, not in um; convert the number"),
        ("strut_2_mm: {value", "strut_3_mm: {value", "struts has no parameter `strut_3_mm`; did you mean `strut_"),
        ("strut_2_mm: {value", "strut_3_mm: {value", "sources[0].parameters: `strut_2_mm` of struts is missing; add it"),
        ('[struts, "", strut_2_mm]', '[struts, "", strut_1_mm]', "the covariance row `struts strut_1_mm` stands here a se"),
        ('[struts, "", strut_2_mm]', '[struts, "", strut_9_mm]', "the covariance row `struts strut_9_mm` names no parameter"),
        ("formula_variance: [", "formula_variance: [0.0, ", "covariance.formula_variance: 7 numbers, 6 were expected"),
        ("null_space:\n  - [", "null_space:\n  - [0.0, ", "null_space[0]: 7 numbers, 6 were expected, one per row name"),
        ("abababab", "abab", "sessions.2026-11-20: string should match pattern"),
        ("value: ", "value: .nan #", "not YAML"),
        ("format: dbb-model/1", "format: dbb-machine/1", "this file is a machine (`dbb-machine/1`), a model (`dbb-model/1`)"),
    ],
)  # fmt: skip
def test_tampering_is_refused(tmp_path: Path, reference, old: str, new: str, said: str) -> None:
    path = tmp_path / "model.yaml"
    write_model(path, drawn(reference, 3))
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_model(path, KNOWN)
    assert any(f"{problem.what}; {problem.remedy}".startswith(said) for problem in caught.value.problems)
    assert all(problem.line for problem in caught.value.problems)


def test_a_file_that_was_cut_short_is_refused(tmp_path: Path, reference) -> None:
    path = tmp_path / "model.yaml"
    write_model(path, drawn(reference, 3))
    lines = path.read_text().splitlines(keepends=True)
    tail = next(i for i, line in enumerate(lines) if line.startswith("covariance"))
    for end in range(tail, len(lines)):
        path.write_text("".join(lines[:end]))
        with pytest.raises(InputError):
            read_model(path, KNOWN)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda c: c.__setitem__((2, 3), c[2, 3] + 0.1 * np.sqrt(c[2, 2] * c[3, 3])), "it is not symmetric: row 3 and column 4"),
        (lambda c: c.__setitem__((2, 2), -c[2, 2]), "the variance in row 3 is negative"),
        (lambda c: c.__setitem__((1, 3), 1e-9), "row 2 has no variance, but covariances"),
        (lambda c: c.__setitem__((slice(2, 4), slice(2, 4)), [[1, 2], [2, 1]]), "it is not positive"),
    ],
)  # fmt: skip
def test_a_matrix_that_is_no_covariance(reference, change, said: str) -> None:
    covariance = drawn(reference, 4).covariance.copy()
    assert covariance_fault(covariance) is None
    change(covariance)
    assert covariance_fault(covariance).startswith(said)


def test_a_matrix_of_another_size(tmp_path: Path, reference) -> None:
    path = tmp_path / "model.yaml"
    write_model(path, drawn(reference, 5))
    text = path.read_text()
    lines = text.splitlines()
    del lines[lines.index("  matrix:") + 1]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="6 rows of as many numbers were expected"):
        read_model(path, KNOWN)


def test_a_model_is_read_by_its_path_alone_and_with_sources_of_ones_own(tmp_path: Path, reference) -> None:
    assert read_model(str(SMALL)).covariance.shape == (10, 10)
    (bow,) = [one for name, one in every_source([EXAMPLE]).items() if name == "scale-bow"]
    model = IdentifiedModel(MachineModel(reference, (Fitted(bow, np.arange(6.0)),)), (), np.zeros((0, 0)))
    path = tmp_path / "bowed.yaml"
    write_model(path, model)
    (read,) = read_model(path, [bow]).model.sources
    assert read.source is bow
    np.testing.assert_array_equal(read.values, np.arange(6.0))
    assert {one.source.name for one in read_model(SMALL, (bow,)).model.sources} >= {"mounting"}
    with pytest.raises(InputError, match="scale-bow"):
        read_model(path)
    with pytest.raises(InputError, match="strut-reference-length"):
        read_model(SMALL, {"scale-bow": bow})
    with pytest.raises(ModelError, match="two of the given error sources are called scale-bow"):
        read_model(path, [bow, bow])


def test_the_example_reads_with_the_package_s_own_sources() -> None:
    model = read_model(SMALL, known_sources())
    assert [one.source.name for one in model.model.sources] == ["strut-reference-length", "bar-offset", "mounting"]
    assert model.covariance.shape == (10, 10)


@pytest.mark.parametrize(
    ("source", "parameter", "value"),
    [
        ("strut-reference-length", "strut_3_mm", 100.0),
        ("strut-reference-length", "strut_3_mm", -2500.0),
        ("base-joints", "joint_2_z_mm", 40.0),
        ("backlash", "strut_1_um", 5e5),
        ("gravity", "strut_compliance_um_kn", 1e4),
        ("unexplained-wave", "strut_6_period_mm", 1e5),
    ],
)
def test_a_value_that_no_machine_has_is_refused_by_its_name(tmp_path, source, parameter, value) -> None:
    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    known = known_sources()
    one = known[source]
    names = [p.name for p in one.parameters(machine)]
    path = tmp_path / "model.yaml"

    def wrote(number: float) -> None:
        values = np.zeros(len(names))
        values[names.index(parameter)] = number
        model = MachineModel(machine, (Fitted(one, values),))
        write_model(path, IdentifiedModel(model, (), np.zeros((0, 0))), force=True)

    limit = one.parameters(machine)[names.index(parameter)].largest
    assert abs(value) > limit
    wrote(value)
    with pytest.raises(InputError) as caught:
        read_model(path, known)
    (problem,) = caught.value.problems
    assert f"{source} {parameter}: {value:g}" in problem.what
    assert "is not plausible" in problem.what
    assert f"{value!r}".rstrip("0").rstrip(".") in path.read_text().splitlines()[problem.line - 1]
    wrote(np.copysign(limit, value))
    read_model(path, known)
