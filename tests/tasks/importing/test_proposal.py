"""What columns are taken for by their names."""

from __future__ import annotations

import pytest

from dbbstation.tasks.importing.proposal import Proposed, proposed, stated


@pytest.mark.parametrize(
    ("names", "units", "expected"),
    [
        (["Winkel [°]", "Abweichung [µm]"], {}, [("angle", "deg"), ("deviation", "µm")]),
        (["Winkel", "Abweichung"], {"Winkel": "[°]", "Abweichung": "μm"}, [("angle", "deg"), ("deviation", "µm")]),
        (["time (ms)", "length_in"], {}, [("time", "ms"), ("length", "inch")]),
        (
            ["t_s", "length_mm", "deviation_um", "bar_temp_c"],
            {},
            [("time", "s"), ("length", "mm"), ("ignored", ""), ("bar_temp_c", "degC")],
        ),
        (["Time", "Radius"], {}, [("time", ""), ("length", "")]),
        (["n", "x", "test"], {}, [("ignored", ""), ("ignored", ""), ("test", "")]),
        (["angle deg", "angle rad", "error µm"], {}, [("angle", "deg"), ("ignored", ""), ("deviation", "µm")]),
    ],
)
def test_names_tell_meaning_and_unit(names, units, expected):
    found = proposed(names, units)
    assert [(found[name].means, found[name].unit) for name in names] == expected


def test_what_is_stated_is_taken_apart():
    assert stated("a=b=angle:deg") == ("a=b", Proposed("angle", "deg"))
    assert stated("Abw=deviation:um") == ("Abw", Proposed("deviation", "µm"))
    assert stated("Nr=ignored") == ("Nr", Proposed("ignored"))
    assert stated("T=bar_temp_c:degC") == ("T", Proposed("bar_temp_c", "degC"))
    for wrong in ("angle", "=angle:deg", "a=angel:deg", "a=angle:mm", "a=test:mm"):
        assert stated(wrong) is None
