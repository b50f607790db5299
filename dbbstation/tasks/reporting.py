"""Compute a model's residual and its causes' contributions for a report of circles."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.diagnosis.diagnose import thinned
from dbbstation.diagnosis.effects import effects_of
from dbbstation.errors import InputError, StationError
from dbbstation.files.source_text import read_bytes, without_faults
from dbbstation.report.content import Modelled
from dbbstation.results.model_warnings import lacks_physics
from dbbstation.results.report_verdict import Ranked
from dbbstation.tasks.evaluate import evaluate
from dbbstation.tasks.load import load_sessions
from dbbstation.tasks.telling import READING, StoppedError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.files.formats.settings import Settings
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.tasks.load import Recorded
    from dbbstation.tasks.telling import Telling

_PHYSICS_MISSING = (
    "Physics is missing from the model: its causes cannot be ranked. `dbbstation diagnose` looks for what it lacks."
)


_PICTURES = {b"\x89PNG\r\n\x1a\n": "png", b"\xff\xd8\xff": "jpeg"}
"""Kinds of pictures by their first bytes."""

LARGEST_LOGO_BYTES = 1_000_000
"""Largest picture of a report, which is sent by mail [bytes]."""


def logo_of(settings: Settings) -> str:
    """Return the shop's picture as a data address; empty without one.

    Raises:
        InputError: it cannot be read, or is no PNG or JPEG picture.
    """
    if (stated := settings.values.get("report.logo")) is None:
        return ""
    path = stated.file.parent / stated.value
    data = without_faults(lambda faults: read_bytes(path, faults, LARGEST_LOGO_BYTES))
    kind = next((kind for begins, kind in _PICTURES.items() if data.startswith(begins)), "")
    if not kind:
        raise InputError.of(path, "no PNG or JPEG picture", f"name one in {stated.origin}")
    return f"data:image/{kind};base64,{b64encode(data).decode()}"


def read_runs(
    sessions: Sequence[SessionFolder], chosen: tuple[Sequence[str], Sequence[str]], telling: Telling
) -> Recorded | StationError:
    """Return recorded runs, or the reason why they cannot be loaded."""
    tests, exclude = chosen
    try:
        found = load_sessions(sessions, exclude, telling.counted(READING), tests)
    except StoppedError:
        raise
    except StationError as error:
        return error
    telling.note(*found.warnings)
    return found


def modelled_runs(runs: Recorded | StationError, identified: IdentifiedModel, telling: Telling) -> Modelled:
    """Return a model's residual, with a note on unsuitable runs."""
    if isinstance(runs, StationError):
        return Modelled(identified, None, str(runs))
    try:
        found = evaluate(runs, identified, progress=telling.stage)
    except StoppedError:
        raise
    except StationError as error:
        return Modelled(identified, None, str(error))
    return Modelled(identified, replace(found, tolerances=None, notes=(*found.notes, *runs.warnings)))


def ranked_causes(
    sessions: Sequence[SessionFolder],
    recorded: Recorded | StationError | None,
    chosen: tuple[Sequence[str], Sequence[str]],
    identified: IdentifiedModel,
    telling: Telling,
) -> Ranked:
    """Return each cause's contribution under nominal programs, with a note on unsuitable sessions.

    Args:
        recorded: the sessions' runs; None: not read yet.
    """
    if lacks_physics(identified.report):
        return Ranked(why_not=_PHYSICS_MISSING)
    recorded = read_runs(sessions, chosen, telling) if recorded is None else recorded
    telling.stage("effects of causes")
    try:
        if isinstance(recorded, StationError):
            raise recorded
        if any(one.commanded is not None for one in recorded.observations):
            return Ranked(
                why_not="The circles ran under compensated programs or a correcting control, in which the model's causes are taken out already: `--before` ranks them on the "
                "circles before."
            )
        runs = [thinned(one) for one in recorded.observations]
        found = effects_of(
            identified.model,
            runs,
            identified.covariance_rows,
            identified.covariance,
            identified.null_space,
            identified.formula_variance,
        )
    except StoppedError:
        raise
    except StationError as error:
        return Ranked(why_not=f"What the model's causes contribute could not be worked out: {error}")
    if not found:
        return Ranked(why_not="The model has no cause that acts on these circles.")
    said = identified.report.get("diagnosis")
    said = said if isinstance(said, Mapping) else {}
    told, picture = (tuple(str(one) for one in said.get(name, ())) for name in ("said", "picture"))
    verdicts = said.get("verdicts", {})
    effects = tuple(replace(one, verdict=verdicts.get(one.cause, "")) for one in found)
    return Ranked(", ".join(dict.fromkeys(session.name for session in sessions)), effects, said=told, picture=picture)
