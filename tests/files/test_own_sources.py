"""Error sources that somebody wrote: from a Python file or an installed package; every fault told with its place."""

from __future__ import annotations

import re
import sys
import textwrap
from functools import cache

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.own_sources import every_source, sources_of
from dbbstation.files.places import shipped_folder
from dbbstation.sources import registry
from dbbstation.sources.contract import Owner
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.sources.trial import trial_machine, tried, undeclared

EXAMPLE = shipped_folder("fixtures") / "sources" / "scale_bow.py"


def own(tmp_path, text, name="own.py"):
    path = tmp_path / name
    path.write_text(textwrap.dedent(text), encoding="utf-8")
    return path


def changed(tmp_path, *pairs):
    text = EXAMPLE.read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return own(tmp_path, text)


def told(*files):
    with pytest.raises(InputError) as refused:
        every_source(files)
    return str(refused.value)


@pytest.fixture
def installed(tmp_path, monkeypatch):
    def install(entry, text=None):
        folder = tmp_path / "site"
        (folder / "bowed-1.0.dist-info").mkdir(parents=True)
        (folder / "bowed-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: bowed\nVersion: 1.0\n")
        (folder / "bowed-1.0.dist-info" / "entry_points.txt").write_text(f"[dbbstation.sources]\nbow = {entry}\n")
        (folder / "bowed_scale.py").write_text(text or EXAMPLE.read_text(encoding="utf-8"), encoding="utf-8")
        monkeypatch.syspath_prepend(folder)
        monkeypatch.delitem(sys.modules, "bowed_scale", raising=False)

    # A memory of its own: the other tests go on with the sources that they have.
    monkeypatch.setattr(registry, "_known", cache(registry._known.__wrapped__))
    return install


def test_without_files_there_are_those_of_the_package():
    assert every_source() == known_sources()


def test_a_file_adds_its_source():
    every = every_source([EXAMPLE])
    assert set(every) - set(known_sources()) == {"scale-bow"}
    assert every["scale-bow"].belongs_to is Owner.MACHINE
    assert sources_of([EXAMPLE], every) == ("scale-bow",)
    assert "scale-bow" not in known_sources()


def test_a_file_given_twice_counts_once(tmp_path):
    assert set(every_source([EXAMPLE, EXAMPLE.parent / "." / EXAMPLE.name])) >= {"scale-bow"}
    del tmp_path


def test_nothing_is_written_beside_the_file(tmp_path):
    path = changed(tmp_path)
    every_source([path])
    assert list(tmp_path.iterdir()) == [path]


def test_a_class_that_others_derive_from_may_leave_things_to_them(tmp_path):
    text = EXAMPLE.read_text(encoding="utf-8").replace("class ScaleBow(LinearSource)", "class ScaleBow(Half)")
    half = "\n\nclass Half(LinearSource):\n    pass\n\n"
    path = own(tmp_path, text.replace("\n\nclass ScaleBow", half + "\n\nclass ScaleBow"))
    assert "scale-bow" in every_source([path])


def test_an_installed_package_adds_its_source(installed):
    installed("bowed_scale:ScaleBow")
    assert "scale-bow" in every_source()
    assert "scale-bow" in known_sources()
    assert sources_named(["scale-bow"]) == (known_sources()["scale-bow"],)


def test_an_installed_package_that_breaks_the_contract_is_refused_wherever_sources_are_asked_for(installed):
    text = EXAMPLE.read_text(encoding="utf-8").replace("1e-3 * place", "np.nan * place")
    installed("bowed_scale:ScaleBow", text)
    for ask in (known_sources, every_source, lambda: sources_named(["gravity"])):
        with pytest.raises(InputError, match="ScaleBow: strut_mm of its derivative is not a number somewhere"):
            ask()


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        ("bowed_scale:Missing", "cannot be loaded: AttributeError"),
        ("no_such_module_at_all:Bow", "cannot be loaded: ModuleNotFoundError"),
        ("bowed_scale:np", "bowed_scale:np is no class that derives from ErrorSource"),
    ],
)
def test_an_entry_point_that_does_not_hold_names_its_package(installed, entry, why):
    installed(entry)
    text = told()
    assert text.startswith(f"entry point bow of the package bowed: {why}")
    assert text.endswith("; mend or uninstall the package bowed")


def test_a_package_and_a_file_with_one_name_are_refused(installed):
    installed("bowed_scale:ScaleBow")
    assert "`scale-bow` is known already, from entry point bow of the package bowed" in told(EXAMPLE)


def test_a_file_that_is_not_there(tmp_path):
    assert told(tmp_path / "none.py").endswith("none.py: there is no such file; check the path")


def test_a_syntax_error_has_its_line(tmp_path):
    assert re.search(r"own\.py:2:\d+: is not Python: ", told(own(tmp_path, "a = 1\nb = = 2\n")))


def test_a_binary_file_is_no_python(tmp_path):
    path = tmp_path / "own.py"
    path.write_bytes(b"\x00\x01a = 1\n")
    assert "own.py" in told(path)
    assert "is not Python" in told(path)


def test_an_error_when_it_is_run_has_its_line(tmp_path):
    assert "own.py:2: cannot be run: ZeroDivisionError: division by zero" in told(own(tmp_path, "a = 1\nb = a / 0\n"))


def test_a_module_that_it_cannot_import_is_named(tmp_path):
    assert "own.py:1: cannot be run: ModuleNotFoundError: No module named 'nowhere_to_be_found'" in told(
        own(tmp_path, "import nowhere_to_be_found\n")
    )


def test_a_file_without_an_error_source(tmp_path):
    assert "own.py: no class in it derives from ErrorSource or TableSource; see " in told(
        own(tmp_path, "class Bow:\n    pass\n")
    )


def test_a_name_that_is_taken(tmp_path):
    text = told(changed(tmp_path, ('"scale-bow"', '"gravity"')))
    assert re.search(r"own\.py:9: an error source `gravity` is known already, from dbbstation itself", text)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('    name = "scale-bow"\n', "", "it needs a `name` in small letters with hyphens"),
        ('"scale-bow"', '"Scale bow"', "it needs a `name` in small letters with hyphens"),
        ("    belongs_to = Owner.MACHINE\n", "", "it needs `belongs_to`, one of Owner.MACHINE, "),
        ("def parameters(", "def parameter(", "it has no parameters"),
        ("def derivative(", "def derived(", "it has no derivative"),
        ("texts = Texts", "text = Texts", "it needs `texts`, a Texts that says what, shows"),
        ('"The scale of a strut is bowed."', '" "', "its texts say nothing under what"),
        ("    belongs_to", '    needs = {"pose"}\n    belongs_to', "its `needs` must be a frozenset of Need"),
        ("detail_mm = SMOOTH_MM", "detail_mm = 0", "its `detail_mm` must be a length above zero"),
        ("50.0, ", "0.0, ", "its parameter strut_1_um needs a plausible size above zero"),
        ("strut_{}_um", "strut_um", "two of its parameters are called strut_um"),
        ("strut_mm=1e-3", "tool_tip_mm=1e-3", "tool_tip_mm of its derivative has the shape (181, 6, 6), not (3, 6)"),
        (" * np.eye(STRUTS))", ")", "strut_mm of its derivative has the shape (181, 6, 1), not (6, 6) or (181, 6, 6)"),
        ("1e-3 * place", "np.nan * place", "strut_mm of its derivative is not a number somewhere"),
        ('"The scale of a strut is bowed."', '"Bowed."', "its texts say nothing under what"),
        (
            "    belongs_to",
            "    form_uncertainty = -0.1\n    belongs_to",
            "its `form_uncertainty` must be a share of the effect",
        ),
        ("strut_{}_um", "strut_{}_mm", "its parameter strut_1_mm must end with its unit, _um"),
        (
            "strut_{}_um",
            "bow_{}_um",
            "its parameter bow_1_um must say with `strut` which strut it is of, as its name does",
        ),
    ],
)
def test_what_is_lacking_of_the_contract_is_told(tmp_path, old, new, why):
    text = told(changed(tmp_path, (old, new)))
    assert re.search(r"own\.py:9: ScaleBow: ", text)
    assert why in text


def test_a_derivative_that_is_not_that_of_the_effect_is_told(tmp_path):
    wrong = "    def effect(self, motion, machine, values):\n        return self.derivative(motion, machine, values).times(2 * values)\n"
    path = own(tmp_path, EXAMPLE.read_text(encoding="utf-8") + "\n" + wrong)
    assert "its derivative of strut_mm by strut_1_um is not what its effect does" in told(path)


@pytest.mark.parametrize(
    ("effect", "why"),
    [
        (
            "self.derivative(motion, machine, values).times(values + 1e-3)",
            "strut_mm of its effect is not zero where all",
        ),
        (
            "self.derivative(motion, machine, values).times(np.abs(values))",
            "its derivative of strut_mm by strut_1_um is not",
        ),
        (
            "self.derivative(motion, machine, values).times(values) if values.any() else Effect()",
            "strut_mm stands in only one of its effect and its derivative where all parameters are zero",
        ),
    ],
)
def test_an_effect_that_no_amplitude_has_is_told(tmp_path, effect, why):
    wrong = f"    def effect(self, motion, machine, values):\n        return {effect}\n"
    assert why in told(own(tmp_path, EXAMPLE.read_text(encoding="utf-8") + "\n" + wrong))


def test_an_effect_that_grows_with_the_square_is_no_amplitude(tmp_path):
    """Its derivative is right, and still the parameter scales nothing: it needs a shape."""
    text = EXAMPLE.read_text(encoding="utf-8").replace("strut_mm=1e-3", "strut_mm=2.0 * values * 1e-3")
    square = "    def effect(self, motion, machine, values):\n        return self.derivative(motion, machine, values).times(0.5 * values)\n"
    assert "is not proportional to its amplitudes" in told(own(tmp_path, text + "\n" + square))


def test_a_source_that_takes_a_motion_without_what_it_needs_is_told(tmp_path):
    text = EXAMPLE.read_text(encoding="utf-8").replace(
        "    belongs_to", "    needs = frozenset({Need.POSE, Need.TIME})\n    belongs_to", 1
    )
    text = text.replace("from dbbstation.sources.contract import ", IMPORTS, 1)
    assert "scale-bow" in every_source([own(tmp_path, text, "right.py")])
    text += "\n    def require(self, motion):\n        pass\n"
    assert "its `require` takes a motion without time, which it needs" in told(own(tmp_path, text))


def test_the_machine_of_the_trial_is_a_hexapod_that_can_move():
    machine = trial_machine()
    base, platform = machine.hexapod.base_joints_mm, machine.hexapod.platform_joints_mm
    struts = platform + np.array([0.0, 0.0, -1000.0]) - base
    lengths = np.linalg.norm(struts, axis=1)
    assert np.ptp(lengths) < 1e-9
    assert machine.travel.strut_mm[0] < lengths[0] < machine.travel.strut_mm[1]
    directions = struts / lengths[:, None]
    held = np.hstack([directions, np.cross(platform, directions) / 400.0])
    assert np.linalg.cond(held) < 50.0


def test_an_error_in_its_own_code_has_its_line(tmp_path):
    path = changed(tmp_path, ("shortest, longest = machine.travel.strut_mm", "shortest, longest = machine.travel"))
    text = told(path)
    assert re.search(r"own\.py:28: ScaleBow: TypeError: .*, when it was tried on a circle", text)


def test_all_faults_of_all_files_are_told(tmp_path):
    first = changed(tmp_path, ('"scale-bow"', '"gravity"'))
    second = own(tmp_path, "b = = 2\n", "second.py")
    assert len(told(first, second, tmp_path / "third.py").splitlines()) == 3


@pytest.mark.parametrize("source", known_sources().values(), ids=lambda s: s.name)
def test_the_trial_finds_nothing_wrong_with_sources_that_are_right(source, reference):
    machine = read_machine(shipped_folder("fixtures") / "machines" / "every-key.yaml")
    assert undeclared(type(source)) == []
    assert tried(source, machine) == []
    assert tried(source, reference) == []


FORM = """
    def by_temperature(self):
        return _Logged()


class _Logged(LinearSource):
    name, belongs_to, texts = ScaleBow.name, ScaleBow.belongs_to, ScaleBow.texts
    needs = frozenset({Need.POSE, Need.TIME, Need.TEMPERATURE})
    varies_with = "temperature"

    def parameters(self, machine):
        return (Parameter("LABEL", "µm/K", 2.0, "bow for each kelvin of the machine"),)

    def derivative(self, motion, machine, values):
        warmer = motion.temperature_degc["machine"] - 20.0
        return Effect(strut_mm=1e-3 * np.tile(warmer[:, None, None], (1, 6, 1)))
"""


@pytest.mark.parametrize(
    ("label", "fault"), [("bow_um_k", None), ("strut_1_um", "must have parameters of other names: strut_1_um")]
)
def test_a_second_form_belongs_to_its_source(tmp_path, label, fault):
    path = own(tmp_path, EXAMPLE.read_text(encoding="utf-8") + FORM.replace("LABEL", label))
    path.write_text(path.read_text().replace("from dbbstation.sources.contract import ", IMPORTS, 1), encoding="utf-8")
    if fault:
        assert fault in told(path)
        return
    every = every_source([path])
    assert sources_of([path], every) == ("scale-bow",)
    assert every["scale-bow"].by_temperature().varies_with == "temperature"


IMPORTS = "from dbbstation.sources.contract import Need, Parameter  # noqa\nfrom dbbstation.sources.contract import "


WOUND = """
import numpy as np
from dbbstation.sources.contract import Effect, LinearSource, Need, Owner, Parameter, Texts


class Wound(LinearSource):
    name = "wound"
    belongs_to = Owner.MACHINE
    needs = frozenset({Need.POSE, Need.PATH})
    texts = Texts(*["Written for a test."] * 6)

    def parameters(self, machine):
        return (Parameter("share_1", "1", 1e-3, "of the way since the beginning"),)

    def derivative(self, motion, machine, values):
        length = motion.struts(machine).length_mm
        way = np.abs(np.diff(length, axis=0, prepend=length[:1])).cumsum(axis=0)
        return Effect(strut_mm=way[:, :, None])
"""


def test_a_source_with_a_history_that_says_nothing_of_states_goes_on_working(tmp_path):
    assert "wound" in every_source([own(tmp_path, WOUND)])


def test_one_that_looks_ahead_is_told_how_to_say_so(tmp_path):
    ahead = WOUND.replace("way[:, :, None]", "(way - way[-1])[:, :, None]")
    assert "hangs on rows that follow: write it from the rows so far, or set `looks_ahead = True`" in told(
        own(tmp_path, ahead)
    )
    said = ahead.replace('name = "wound"', 'name = "wound"\n    looks_ahead = True')
    assert "wound" in every_source([own(tmp_path, said, "said.py")])


def test_states_that_do_not_hold_are_told(tmp_path):
    forgets = (
        WOUND
        + """
    def advance(self, motion, machine, values, state):
        return self.effect(motion, machine, values), None
"""
    )
    assert "of its `advance` along two stretches is not its effect along both" in told(own(tmp_path, forgets))
