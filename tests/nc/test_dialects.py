"""A new dialect is one new file."""

from __future__ import annotations

import importlib.metadata
from typing import ClassVar

import numpy as np
import pytest

import dbbstation.nc.dialects
from dbbstation.errors import InputError, StationError
from dbbstation.files.own_dialects import dialect_given
from dbbstation.nc.dialect import Dialect
from dbbstation.nc.registry import GROUP, dialect_named, dialect_of_file, known_dialects
from dbbstation.nc.toolpath import ToolpathBuilder

ONE_FILE = '''
"""A dialect for a test."""

from dbbstation.nc.dialect import Dialect


class Shouting(Dialect):
    name = "shouting"
    extension = ".loud"
    what = "a control that shouts"

    def write(self, toolpath, header=()):
        return "\\n".join(["GO!"] * len(toolpath))

    def read(self, text, name, *, start=None):
        raise NotImplementedError
'''


@pytest.fixture
def one_more(tmp_path, monkeypatch):
    (tmp_path / "shouting_dialect.py").write_text(ONE_FILE)
    monkeypatch.setattr(dbbstation.nc.dialects, "__path__", [*dbbstation.nc.dialects.__path__, str(tmp_path)])
    known_dialects.cache_clear()
    yield
    known_dialects.cache_clear()


@pytest.mark.usefixtures("one_more")
def test_a_file_in_the_folder_is_a_dialect():
    assert {"linuxcnc", "shouting"} <= set(known_dialects())
    path = ToolpathBuilder("x")
    path.rapid(np.zeros(6))
    assert dialect_named("shouting").write(path.built()) == "GO!"
    assert dialect_of_file("a/B.LOUD", "GO!").name == "shouting"


def test_an_unknown_dialect_is_refused_with_the_known_ones():
    with pytest.raises(StationError, match=r"known are .*linuxcnc"):
        dialect_named("shouting")


def test_every_dialect_describes_itself():
    for name, dialect in known_dialects().items():
        assert dialect.name == name
        assert dialect.extension.startswith(".")
        assert dialect.what


class Beginning:
    """A dialect of `.ngc` files that begin with its own word."""

    name: ClassVar[str]

    def write(self, toolpath, header=()):
        raise NotImplementedError

    def read(self, text, name, *, start=None):
        raise NotImplementedError

    def is_in(self, text):
        return text.startswith(self.name)


@pytest.fixture
def two_of_one_ending(monkeypatch):
    def kind(name):
        return type(name, (Beginning, Dialect), {"name": name, "extension": ".loud", "what": "a control"})

    points = [EntryPoint(kind("alpha")), EntryPoint(kind("beta"))]
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda *, group: points if group == GROUP else [])
    known_dialects.cache_clear()
    yield
    known_dialects.cache_clear()


class EntryPoint:
    """One of an installed package."""

    def __init__(self, kind):
        self.name = self.value = kind.name
        self.dist = None
        self.load = lambda: kind


@pytest.mark.usefixtures("two_of_one_ending")
def test_two_dialects_with_one_ending_are_told_apart_by_the_program():
    assert dialect_of_file("x.loud", "alpha 1").name == "alpha"
    assert dialect_of_file("x.loud", "beta 1").name == "beta"
    with pytest.raises(StationError, match=r"x.loud: the program may be in several NC dialects: alpha, beta; .*--from"):
        dialect_of_file("x.loud", "gamma 1")


def test_a_package_with_a_name_that_is_taken_is_told(monkeypatch):
    taken = type("Taken", (Beginning, Dialect), {"name": "linuxcnc", "extension": ".x", "what": "a control"})
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda *, group: [EntryPoint(taken)] if group == GROUP else []
    )
    known_dialects.cache_clear()
    with pytest.raises(InputError, match="an NC dialect `linuxcnc` is known already, from dbbstation itself"):
        known_dialects()
    known_dialects.cache_clear()


OWN = """
from dbbstation.nc.dialects.linuxcnc import LinuxCNC


class Own(LinuxCNC):
    name = "own"
    extension = ".own"
    what = "a control of one's own"
"""


def test_a_dialect_of_ones_own_is_given_by_its_file(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    dialect = dialect_given(str(tmp_path / "own.py"))
    assert (dialect.name, dialect.extension) == ("own", ".own")
    assert dialect_given("linuxcnc") is dialect_named("linuxcnc")


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('    name = "own"\n', "    name = None\n", r"own\.py:5: Own: it needs `name`, a text; see `A new dialect`"),
        ('".own"', '"own"', r"own\.py:5: Own: its `extension` must begin with a dot"),
        ("class Own(LinuxCNC)", "class Own", r"own\.py: no class in it derives from Dialect"),
        (
            "class Own",
            "class Other(LinuxCNC):\n    name = 'other'\n\n\nclass Own",
            "several dialects in it: Other, Own",
        ),
        (
            "    what",
            "    def read(self, text, name, *, start=None):\n        return None\n\n    what",
            "AttributeError",
        ),
        (
            "    what",
            "    def write(self, path, header=()):\n        return LinuxCNC.write(self, path).replace('X10.5', 'X9.5')\n\n    what",
            "it does not read the two moves that it wrote",
        ),
    ],
)
def test_what_a_dialect_of_ones_own_lacks_is_told(tmp_path, old, new, why):
    assert old in OWN
    (tmp_path / "own.py").write_text(OWN.replace(old, new))
    with pytest.raises(InputError, match=why):
        dialect_given(str(tmp_path / "own.py"))
