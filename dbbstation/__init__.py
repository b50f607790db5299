"""Measure, calibrate, diagnose and compensate a hexapod machine tool with a double ball bar.

`import dbbstation as dbb` has a dozen names, loaded on first use. They are provisional until 1.0; the changelog lists
changes.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType

__version__ = "0.1.0"

_PUBLIC = {
    "ArgumentError": "dbbstation.errors",
    "Program": "dbbstation.tasks.programs",
    "StationError": "dbbstation.errors",
    "calibrate": "dbbstation.tasks.calibrate",
    "circle": "dbbstation.tasks.circles",
    "circles": "dbbstation.tasks.circles",
    "compare": "dbbstation.tasks.compare",
    "compensate": "dbbstation.tasks.compensate",
    "diagnose": "dbbstation.tasks.diagnose",
    "evaluate": "dbbstation.tasks.evaluate",
    "history": "dbbstation.tasks.history",
    "known_instruments": "dbbstation.instrument.library",
    "known_sources": "dbbstation.tasks.known",
    "identify": "dbbstation.tasks.drive",
    "load": "dbbstation.tasks.load",
    "mismatch": "dbbstation.tasks.mismatch",
    "predict": "dbbstation.tasks.predict",
    "read_model": "dbbstation.tasks.models",
    "simulate": "dbbstation.tasks.simulate",
    "write_model": "dbbstation.tasks.models",
}
"""Public names, and the module of each; `__init__.pyi` has their types."""

__all__ = [
    "ArgumentError",
    "Program",
    "StationError",
    "__version__",
    "calibrate",
    "circle",
    "circles",
    "compare",
    "compensate",
    "diagnose",
    "evaluate",
    "history",
    "identify",
    "known_instruments",
    "known_sources",
    "load",
    "mismatch",
    "predict",
    "read_model",
    "simulate",
    "write_model",
]


def __getattr__(name: str) -> object:
    """Load a public name on first use, so that help need not wait for SciPy."""
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(_PUBLIC[name]), name)
    globals()[name] = found
    return found


class _Package(ModuleType):
    """Keeps public functions that share the name of a folder: otherwise an import of `dbbstation.circles.path` would replace the function `circles`."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _PUBLIC and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC})
