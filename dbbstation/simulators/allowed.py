"""Check that the user has allowed a simulator, by the hash of its files."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.catalogue import files_of_packages, looked_up
from dbbstation.errors import OutputError, StationError
from dbbstation.files.atomic import write_text
from dbbstation.files.formats.simulator import read_simulator
from dbbstation.files.gateway import content_of, sha256_hex
from dbbstation.files.keys import digests_of
from dbbstation.files.places import real_path, shipped_folder
from dbbstation.simulators.program import whole_command

if TYPE_CHECKING:
    from collections.abc import Collection

    from dbbstation.files.formats.simulator import SimulatorFile

_LOG = logging.getLogger(__name__)


GROUP = "dbbstation.simulators"
"""Entry points of this group name packages; every `.yaml` file in such a package's folder is a simulator."""


def simulator_file(name_or_file: str) -> Path:
    """Return the file of an installed simulator, or the named `.yaml` file.

    Raises:
        StationError: nothing has this name.
        InputError: an invalid entry point, or a taken name.
    """
    if name_or_file.endswith((".yaml", ".yml")):
        return Path(name_or_file)
    how = "give a .yaml file, or install its package"
    return looked_up(name_or_file, _installed(), called="simulator", error=StationError, how_to_add=how)


def _installed() -> dict[str, Path]:
    return files_of_packages(GROUP, (), called="a simulator")


def require_allowed(path: Path, settings: Collection[str], *, allow: bool) -> str:
    """Refuse a simulator that the user has not allowed; shipped ones are allowed.

    Returns the reason if the permission could not be stored, or an empty text.

    Args:
        path: of `model.yaml`; nothing of it is run here.
        settings: hashes that the user's settings allow.

    Raises:
        StationError: it is not allowed.
        InputError: faults of its file.
    """
    of_user = {real_path(one) for one in _installed().values()}  # installing a package is permission
    if real_path(path) in of_user or real_path(path).is_relative_to(
        real_path(shipped_folder("fixtures") / "simulators")
    ):
        return ""
    file = read_simulator(path)
    key = key_of_simulator(path, file)
    if key in settings or key in _noted():
        return ""
    if allow:
        return _note(key, path)
    runs = file.python or file.fmu or " ".join(file.program or ())
    remedy = f"read its files; if you trust them, give --allow once, or put {key} into `simulators` of your settings"
    raise StationError(f"it runs `{runs}`, which you have not allowed", where=str(path), remedy=remedy)


def key_of_simulator(path: Path, file: SimulatorFile) -> str:
    """Return the SHA-256 of all files that define a simulator."""
    named = digests_of([path, *files_of_simulator(path, file)], path.parent)
    return sha256_hex(json.dumps(sorted(named)))


def files_of_simulator(path: Path, file: SimulatorFile) -> list[Path]:
    """Return the files that `model.yaml` names, and their neighbours with the same ending; for Python also packages."""
    words = file.program and whole_command(file.program, path.parent)
    named = [Path(word) for word in words or () if Path(word).is_file()]
    named += [path.parent / one for one in (file.python, file.fmu) if one]
    found = set(named)
    for one in named:
        folder = real_path(one).parent
        # Programs of the system have neighbours that are not the simulator's.
        if one.suffix and folder.is_relative_to(real_path(path.parent)):
            found.update(beside for beside in folder.glob(f"*{one.suffix}") if beside.is_file())
        if one.suffix == ".py":
            packages = [init.parent for init in folder.glob("*/__init__.py")]
            found.update(inner for package in packages for inner in package.rglob("*.py"))
    return sorted(found)


def allowed_file() -> Path:
    """Return the file of allowed simulators in the user's data folder."""
    import platformdirs  # noqa: PLC0415 - only who simulates looks for it

    return Path(platformdirs.user_data_path("dbbstation", appauthor=False)) / "allowed-simulators.txt"


def _noted() -> set[str]:
    try:
        lines = content_of(allowed_file()).decode("utf-8", "replace").splitlines()
    except OSError:
        return set()
    return {line.partition(" ")[0] for line in lines}


def _note(key: str, path: Path) -> str:
    file = allowed_file()
    lines = [*sorted(_noted()), key]
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_text(file, "\n".join(lines) + "\n", force=True)
    except (OSError, OutputError) as error:
        return f"the simulator is not noted as allowed: {error}"
    _LOG.info("allowed the simulator %s, %s", path, key)
    return ""
