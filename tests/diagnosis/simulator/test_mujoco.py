"""An arm in MuJoCo with a concealed spring, end to end."""

import pytest

from dbbstation.diagnosis.simulator.answer import find
from dbbstation.diagnosis.simulator.contract import simulated
from tests.diagnosis.simulator import arm


def asked(seed, spring):
    model, simulator, known = arm.model_of(seed, spring), arm.Arm(), {}

    def run(asks):
        for ask in asks:
            if ask not in known:
                known[ask] = simulated(simulator, model, ask)
        return [known[ask] for ask in asks]

    return find(model, run)


@pytest.mark.nightly
def test_a_spring_in_the_elbow_is_found_behind_the_load_that_hid_it():
    answer = asked(1, arm.SPRING)
    (found,) = answer.identified
    assert found.name == "linear of angle at elbow"
    value = found.values["coefficient"]
    assert abs(value.value + arm.SPRING) < 3.0 * value.uncertainty
    load = next(one for one in answer.parameters if one.name == "load")
    assert abs(load.corrected.value - arm.LOAD) < 4.0 * load.corrected.uncertainty


@pytest.mark.nightly
def test_nothing_is_named_in_an_arm_that_lacks_nothing():
    assert not asked(2, 0.0).identified
