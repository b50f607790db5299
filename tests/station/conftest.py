from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.instrument.leaks import nothing_left_open
from tests.station.bench import SHORT_PLAN

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["nothing_left_open"]


@pytest.fixture
def plan_file(tmp_path: Path) -> Path:
    path = tmp_path / "short.yaml"
    path.write_text(SHORT_PLAN, encoding="utf-8")
    return path
