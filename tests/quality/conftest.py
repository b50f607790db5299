"""Sound sessions that several files judge; none changes them."""

from __future__ import annotations

import pytest

from tests.quality.sessions import Sound, calibrated, sound


@pytest.fixture(scope="session")
def four_tests(tmp_path_factory: pytest.TempPathFactory) -> Sound:
    """Four tests of a machine without a model; the first one is repeated at the end."""
    return sound(tmp_path_factory.mktemp("four") / "session", 5, "abdh")


@pytest.fixture(scope="session")
def six_tests(tmp_path_factory: pytest.TempPathFactory) -> Sound:
    return sound(tmp_path_factory.mktemp("six") / "session", 5, "abdfhk")


@pytest.fixture(scope="session")
def modelled(tmp_path_factory: pytest.TempPathFactory) -> Sound:
    """A machine with the model of its own session."""
    return calibrated(tmp_path_factory.mktemp("modelled"), 1001)
