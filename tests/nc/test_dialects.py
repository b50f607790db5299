"""A new dialect is one new file."""

from __future__ import annotations

import numpy as np
import pytest

import dbbstation.nc.dialects
from dbbstation.errors import StationError
from dbbstation.nc.registry import dialect_named, dialect_of_file, known_dialects
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
    assert dialect_of_file("a/B.LOUD").name == "shouting"


def test_an_unknown_dialect_is_refused_with_the_known_ones():
    with pytest.raises(StationError, match=r"known are .*linuxcnc"):
        dialect_named("shouting")


def test_every_dialect_describes_itself():
    for name, dialect in known_dialects().items():
        assert dialect.name == name
        assert dialect.extension.startswith(".")
        assert dialect.what
