from __future__ import annotations

from tests.instrument.leaks import nothing_left_open

__all__ = ["nothing_left_open"]
