"""LinuxCNC's parameter file: numbers and values, one a line, and what is wrong with others."""

from __future__ import annotations

import pytest

from dbbstation.errors import InputError
from dbbstation.files.formats.linuxcnc_control import parameters_of


def test_parameters_are_read_by_their_numbers():
    assert parameters_of("5221\t20.000000\n\n 5222 -5e-1 \n", "linuxcnc.var") == {5221: 20.0, 5222: -0.5}


def test_a_line_that_is_none_is_named():
    with pytest.raises(InputError, match=r"linuxcnc\.var:2:1: this is not a line of a parameter file"):
        parameters_of("5221\t20.0\n5222\n", "linuxcnc.var")
    with pytest.raises(InputError, match="no parameter in it"):
        parameters_of("\n", "linuxcnc.var")
