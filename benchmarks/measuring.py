"""How the benchmarks measure and print.

Every figure is a ratio to a peer that runs in the same process, minutes apart at most, because absolute times differ
between machines and from hour to hour on a shared one. A time is the best of several calls after one that warms up
(which compiles, loads and fills caches): the best is what the work costs, anything above it is somebody else's. The
median beside it says how much of that there was.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

# As the command line does, before NumPy is imported: peers are measured with one thread of linear algebra, too.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parent.parent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


@dataclass(frozen=True)
class Timing:
    """Seconds of one piece of work, best and median of several calls."""

    best_s: float
    median_s: float
    calls: int


def timed(work: Callable[[], object], calls: int) -> Timing:
    """Time so many calls after one to warm up."""
    work()
    seconds = []
    for _ in range(calls):
        began = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - began)
    return Timing(min(seconds), statistics.median(seconds), calls)


def timed_once(work: Callable[[], object]) -> float:
    """Time one call that nothing warmed up [s]."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


@dataclass(frozen=True)
class Row:
    """One line of a table: a value with its unit, and what it is of."""

    what: str
    value: float
    unit: str
    remark: str = ""


def machine() -> str:
    """Processor, cores and versions that the figures depend on."""
    model = platform.processor() or platform.machine()
    description = Path("/proc/cpuinfo")
    if description.exists():
        names = [line for line in description.read_text(encoding="utf-8").splitlines() if line.startswith("model name")]
        model = names[0].split(":", 1)[1].strip() if names else model
    import numba  # noqa: PLC0415 - heavy, and a benchmark of starting times must not have it loaded
    import numpy as np  # noqa: PLC0415
    import scipy  # noqa: PLC0415

    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    versions = f"Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}"
    return f"{model}, {os.cpu_count()} cores{load}; {versions}, Numba {numba.__version__}"


def show(title: str, rows: Sequence[Row], method: str) -> None:
    """Print a table, or the same numbers as JSON where the command line asks for it."""
    if "--json" in sys.argv[1:]:
        print(json.dumps({"title": title, "machine": machine(), "method": method, "rows": [asdict(r) for r in rows]}))
        return
    width = max(len(row.what) for row in rows)
    print(f"{title}\n{machine()}\n{method}\n")
    for row in rows:
        print(f"{row.what:<{width}}  {row.value:>12,.4g} {row.unit:<9} {row.remark}".rstrip())
