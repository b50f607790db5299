"""The largest memory of this process, as the system says it."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from studies.memory import forget_largest_memory, largest_memory_mb

LARGE_MB = 200.0


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says and forgets it")
def test_what_was_forgotten_does_not_count():
    forget_largest_memory()
    before = largest_memory_mb()
    filled = np.ones(int(LARGE_MB * 1024**2 / 8))
    with_it = largest_memory_mb()
    assert with_it > before + 0.9 * LARGE_MB
    del filled
    assert largest_memory_mb() > with_it - 0.1 * LARGE_MB
    forget_largest_memory()
    assert largest_memory_mb() < with_it - 0.9 * LARGE_MB


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says and forgets it")
def test_what_the_library_keeps_of_freed_blocks_does_not_count():
    blocks = [np.ones(1000) for _ in range(int(LARGE_MB * 1024**2 / 8000))]
    with_them = largest_memory_mb()
    last = np.ones(1000)
    del blocks
    forget_largest_memory()
    assert largest_memory_mb() < with_them - 0.8 * LARGE_MB
    assert last.sum() == 1000.0
