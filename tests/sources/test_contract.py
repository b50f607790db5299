"""What every error source promises: declared parameters, derivatives that fit the effect, needs refused by name."""

from __future__ import annotations

import importlib
import re
from dataclasses import fields, replace

import numpy as np
import pytest

from dbbstation.catalogue import InFolders
from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Rotation
from dbbstation.sources import causes
from dbbstation.sources.causes.gravity import Gravity
from dbbstation.sources.contract import Effect, ErrorSource, Need, Owner
from dbbstation.sources.registry import known_sources, sources_named
from tests.sources.runs import random_machine, random_run

SOURCES = list(known_sources().values())
SOURCES += [law for source in SOURCES for law in source.other_laws()]
WITHOUT = {
    Need.PATH: {"is_path": False},
    Need.TIME: {"time_s": None},
    Need.TEMPERATURE: {"logged": {}},
    Need.CURRENT: {"logged": {}},
    Need.READING: {"reading_mm": None},
}


@pytest.fixture(params=list(Rotation))
def machine(request, reference, rng):
    return random_machine(reference, request.param, rng)


def some_values(parameters, rng):
    """Two or three times the usual size, of either sign for what is no time constant."""
    factor = rng.uniform(0.5, 3, len(parameters))
    signs = np.array([1.0 if parameter.grid else rng.choice([-1.0, 1.0]) for parameter in parameters])
    return signs * factor * [parameter.plausible for parameter in parameters]


def arrays(effect: Effect):
    return {f.name: getattr(effect, f.name) for f in fields(effect) if getattr(effect, f.name) is not None}


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.name)
def test_derivative_is_that_of_the_effect(source, machine, rng):
    parameters = source.parameters(machine)
    for _ in range(3):
        motion, values = random_run(rng), some_values(parameters, rng)
        derivative = arrays(source.derivative(motion, machine, values))
        here = arrays(source.effect(motion, machine, values))
        assert derivative.keys() == here.keys()
        for k, parameter in enumerate(parameters):
            step = 1e-5 * parameter.plausible * np.eye(len(parameters))[k]
            ends = [arrays(source.effect(motion, machine, values + sign * step)) for sign in (1, -1)]
            for name, exact in derivative.items():
                after, before = (ends[0][name] - here[name]) / step[k], (here[name] - ends[1][name]) / step[k]
                # A source with play has kinks, where the derivatives to either side differ; the rest must agree.
                scale = np.abs(exact[..., k]).max(initial=0) + 1e-300
                # A play that is hardly shaken does not depend on the shaking: the differences are those of rounding.
                rounding = 8.0 * np.finfo(float).eps * np.abs(here[name]).max(initial=0) / step[k]
                smooth = np.abs(after - before) < 1e-3 * scale + rounding
                assert smooth.mean() > 0.98
                assert np.abs((after + before) / 2 - exact[..., k])[smooth].max(initial=0) < 1e-4 * scale + rounding


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.name)
def test_nothing_comes_of_nothing_and_amplitudes_are_in_proportion(source, machine, rng):
    parameters, motion = source.parameters(machine), random_run(rng)
    nothing = source.effect(motion, machine, np.zeros(len(parameters)))
    assert all(np.allclose(array, 0, atol=1e-15) for array in arrays(nothing).values())
    assert set(arrays(source.derivative(motion, machine, np.zeros(len(parameters))))) == set(arrays(nothing))
    if Need.PATH not in source.needs:  # the range of a play hangs on its width
        values = some_values(parameters, rng)
        doubled = values * np.where([bool(p.grid) for p in parameters], 1.0, 2.0)
        once, twice = (arrays(source.effect(motion, machine, v)) for v in (values, doubled))
        assert all(np.allclose(twice[name], 2 * once[name], rtol=1e-12) for name in once)


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.name)
def test_a_motion_without_what_it_needs_is_refused_by_name(source, rng):
    complete = random_run(rng)
    source.require(complete)
    for need in source.needs - {Need.POSE}:
        with pytest.raises(ModelError, match=f"the error source {source.name} needs {need}"):
            source.require(replace(complete, **WITHOUT[need]))


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.name)
def test_parameters_and_texts_are_complete(source, machine):
    parameters = source.parameters(machine)
    assert len({parameter.name for parameter in parameters}) == len(parameters) > 0
    for parameter in parameters:
        unit = parameter.unit.lower().translate(str.maketrans({"µ": "u", "/": "_", " ": "_", "(": "", ")": ""}))
        assert parameter.name.endswith(f"_{unit}")
        assert parameter.plausible > 0
        assert len(parameter.meaning.split()) > 3
        named = re.match(r"(?:strut|joint)_([1-6])_", parameter.name)
        assert parameter.strut == (int(named[1]) if named else None)
        assert not parameter.grid or min(parameter.grid) <= parameter.plausible <= max(parameter.grid)
    for f in fields(source.texts):
        assert len(getattr(source.texts, f.name)) > 9, f.name
    assert source.belongs_to in Owner
    (listed,) = sources_named([source.name])
    assert source is listed or type(source) in {type(law) for law in listed.other_laws()}


def test_an_unknown_source_is_refused_with_those_that_exist():
    with pytest.raises(ModelError, match=r"no error source is called 'wear'; known are .*gravity"):
        sources_named(["wear"])
    with pytest.raises(ModelError, match=r"no error source is called 'gravitation'; did you mean gravity\?"):
        sources_named(["gravitation"])


def test_a_source_is_looked_up_in_its_own_file_alone(monkeypatch):
    imported, load = [], importlib.import_module
    monkeypatch.setattr(importlib, "import_module", lambda name: imported.append(name) or load(name))
    found = InFolders(ErrorSource, causes)
    assert found["mounting"].name == "mounting"
    assert imported == [f"{causes.__name__}.mounting"]
    assert {name.replace("-", "_") for name in found} == {name.removeprefix(f"{causes.__name__}.") for name in imported}


def test_a_law_is_named_by_its_class_or_by_what_the_error_varies_with():
    class OfForce(Gravity):
        law = "by a table"

    class OfTime(Gravity):
        varies_with = "time"

    assert (OfForce.law, OfTime.law, Gravity.law) == ("by a table", "time", Gravity.varies_with)
    assert [one.law for one in Gravity().other_laws()] == ["contacts"]
