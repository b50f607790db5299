"""Sessions with their diagnosis, for tasks and studies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.calibration.fit.calibrate import default_sources
from dbbstation.diagnosis import diagnose as search
from dbbstation.diagnosis.diagnose import usable_sources
from dbbstation.errors import ModelError
from dbbstation.facts.serialise import plain
from dbbstation.results.diagnosis import diagnosis_figures
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import loaded
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.diagnosis.findings import Diagnosis
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.load import Recorded, Sessions


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """Recorded sessions with their diagnosis."""

    recorded: Recorded
    diagnosis: Diagnosis
    lacking: Mapping[str, str]

    def summary(self) -> dict[str, object]:
        """Return all results as plain numbers."""
        return plain(diagnosis_figures(self.diagnosis, self.lacking))


def default_candidates(known: Mapping[str, ErrorSource]) -> list[str]:
    """Return the error sources that are not always fitted."""
    fitted = {source.name for source in default_sources()}
    return [name for name, source in known.items() if name not in fitted and source.candidate]


def diagnosed_of(
    sessions: Sessions | Recorded,
    candidates: Sequence[str] | None,
    chosen: tuple[Sequence[str], Sequence[str]],
    known: Mapping[str, ErrorSource],
    telling: Telling,
    how: Callable[..., Diagnosis] = search.diagnose,
) -> Diagnosed:
    """Read sessions and diagnose them.

    Raises:
        InputError: faults of files and traces.
        ModelError: an unknown source, or one that is no cause.
    """
    named = sources_named(default_candidates(known) if candidates is None else candidates, known)
    for source in named:
        if not source.candidate:
            what = f"{source.name} is no cause: it only keeps in a model what a diagnosis left without a name"
            raise ModelError(what, remedy="leave it out; the model of a diagnosis keeps the effect")
    recorded = loaded(sessions, *chosen, telling)
    usable, lacking = usable_sources(recorded.machine, recorded.observations, named)
    found = how(recorded.machine, recorded.observations, usable, telling.stage)
    return Diagnosed(recorded, found, lacking)
