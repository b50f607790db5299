"""What refitted parameters hide is found in tables as a user writes them, and its clean twin is silent; all cases: `concealed`."""

import pytest

from tests.diagnosis.table import concealed, domains
from tests.diagnosis.table.concealed import answer

pytestmark = pytest.mark.usefixtures("few_parts")


@pytest.fixture(autouse=True)
def fewer_rows(request, monkeypatch):
    """Half the rows of the study, or a third; the nightly tests have all, and so has creep, which half of them leave ambiguous."""
    if "not nightly" in request.config.option.markexpr and "creep" not in request.node.name:
        monkeypatch.setattr(concealed, "ROWS", 200 if "expansion" in request.node.name else 300)


@pytest.mark.parametrize(("case", "size"), [("payload", 2.0), ("expansion", 5.0)])
def test_a_product_is_named_without_its_lines(case, size):
    """Its factors are zero at other places than the middles of their ranges."""
    said = answer(case, 1, "averaged", size)
    assert said["answer"] == "right", said


def test_the_drag_of_air_is_named_with_its_coefficient():
    said = domains.answer("pendulum", 103, what="effect")
    assert said["laws"] == ["drag of rate_rad_s"]
    assert abs(said["off_u"]["drag of rate_rad_s: coefficient"]) < 3.0
    assert said["left"] < 0.02


@pytest.mark.parametrize("case", ["load-cell", "creep", "dead-time"])
def test_what_the_parameters_hide_is_found(case):
    said = answer(case, 3, "white", 5.0)
    assert said["answer"] == "right", said
    if case != "dead-time":  # which no gain can do
        assert float(said["hidden"]) > 0.4


@pytest.mark.parametrize("case", [pytest.param("payload", marks=pytest.mark.nightly), "creep"])
def test_nothing_is_found_in_its_clean_twin(case):
    said = answer(case, 3, "averaged", 0.0)
    assert said["answer"] == "nothing", said
    assert said["identified"] == said["happened"] == ""
