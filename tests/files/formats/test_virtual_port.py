"""Names of ports that mean a virtual machine."""

import pytest

from dbbstation.service.memory import Line
from dbbstation.system.ports import misspelt, time_scale_of, virtual_port


@pytest.mark.parametrize("scale", [0.01, 0.5, 1.0, 2.5, 10.0, 20.0, 50.0])
def test_a_virtual_port_has_its_time_in_its_name(scale: float) -> None:
    name = virtual_port(scale)
    assert time_scale_of(name) == scale
    assert not misspelt(name)
    line = Line(port=name)
    assert (line.virtual, line.time_scale) == (True, scale)


@pytest.mark.parametrize(
    "name",
    [
        "virtual",
        "Virtual machine",
        "virtual machine, 100 times faster",
        "virtual machine, fast",
        "virtual machine, 0 times faster",
    ],
)
def test_other_names_that_begin_so_are_mistakes(name: str) -> None:
    assert time_scale_of(name) is None
    assert misspelt(name)
    assert not Line(port=name).virtual


@pytest.mark.parametrize("name", ["/dev/ttyUSB0", "COM3", "socket://127.0.0.1:4001", ""])
def test_real_ports_are_none(name: str) -> None:
    assert time_scale_of(name) is None
    assert not misspelt(name)
