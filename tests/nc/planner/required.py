"""Whether tests with LinuxCNC may be skipped: `DBBSTATION_REQUIRE=linuxcnc`, which `.ci/run` sets, turns that into a failure."""

from __future__ import annotations

import os

import pytest

REQUIRED = "linuxcnc" in os.environ.get("DBBSTATION_REQUIRE", "").split()


def needs(lacking: str) -> pytest.MarkDecorator:
    """Skip tests for this reason, if there is one; run them, so that they fail, where they are required."""
    return pytest.mark.skipif(bool(lacking) and not REQUIRED, reason=lacking or "it is there")
