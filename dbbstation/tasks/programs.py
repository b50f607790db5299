"""Common parts of writing compensated programs."""

from __future__ import annotations

import codecs
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.errors import ArgumentError
from dbbstation.files.formats.linuxcnc_control import parameters_of, tools_of
from dbbstation.files.gateway import sha256_of_blocks
from dbbstation.files.source_text import blocks_of
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.export import Inverse
from dbbstation.nc.setup import FIRST_PARAMETERS, ControlSetup
from dbbstation.nc.spilled import LongText
from dbbstation.results.model_warnings import model_warnings, unknown_causes
from dbbstation.tasks.models import model_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from dbbstation.files.provenance import Provenance
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.models import Model


@dataclass(frozen=True)
class ProgramText:
    """An NC program in memory."""

    text: str
    name: str = "program.ngc"

    def __repr__(self) -> str:
        return f"<Program {self.name}: {len(self.text.splitlines())} lines>"


Program = ProgramText
"""Name for scripts."""


NOT_CORRECTED = "cause unknown, not corrected"
"""Title of the model's uncorrected errors in a program's header."""


def inverse_of(
    model: Model,
    known: Mapping[str, ErrorSource] | None = None,
    *,
    time_s: float | None,
    largest_mm: float,
    prefer: str,
    strict: bool,
    unexplained: bool = True,
) -> Inverse:
    """Return the model to compensate with; the header names its file and sessions by hash.

    Args:
        unexplained: also compensate errors of unknown cause.

    Raises:
        InputError: every fault with its place.
        ValueError: an unknown `prefer`.
    """
    identified = model_of(model, known)
    origin = {"model file": hashed(Path(model))} if isinstance(model, str | PathLike) else {}
    if not unexplained:
        unknown = unknown_causes(identified.model)
        origin |= {f"{NOT_CORRECTED} {k}": name for k, name in enumerate(unknown, start=1)}
        known_ones = tuple(one for one in identified.model.sources if one.source.name not in unknown)
        identified = replace(identified, model=replace(identified.model, sources=known_ones))
    origin |= {f"cause unknown {k}": name for k, name in enumerate(unknown_causes(identified.model), start=1)}
    origin |= {f"model warning {k}": text for k, text in enumerate(model_warnings(identified), start=1)}
    origin |= {f"session {name}": f"sha256 {digest}" for name, digest in identified.sessions.items()}
    return Inverse(identified.model, origin, time_s, identified, largest_mm, Prefer(prefer), strict)


def origin_of(named: Mapping[str, Path], inverse: Inverse | None, provenance: Provenance) -> dict[str, str]:
    """Return a program's origin for its header: files by role, this program, its command, and other inputs.

    Raises:
        InputError: a file cannot be read.
    """
    files = {what: hashed(path) for what, path in named.items()}
    return {**files, **provenance.comments({**files, **({} if inverse is None else inverse.origin)})}


def hashed(path: Path) -> str:
    """Return a file's name without folder and its SHA-256.

    Raises:
        InputError: it cannot be read.
    """
    return f"{path.name}, sha256 {sha256_of(path)}"


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file; raises InputError if unreadable."""
    return sha256_of_blocks(blocks_of(path))


def source_of(program: str | PathLike[str] | ProgramText) -> Path | ProgramText:
    """Return the path of a program, or its text.

    Raises:
        ArgumentError: a text that is not wrapped as `Program(text)`.
    """
    if isinstance(program, str) and "\n" in program:
        raise ArgumentError("program", "a text is given as `Program(text)`; a string is the name of a file")
    return program if isinstance(program, ProgramText) else Path(program)


def program_of(path: Path | ProgramText) -> LongText:
    """Return a program, from UTF-8, UTF-16 with a byte order mark, or else Windows' code page, which matters in comments only.

    Raises:
        InputError: it cannot be read.
    """
    if isinstance(path, ProgramText):
        return LongText.of(path.text)
    content = LongText(blocks_of(path))
    if content.letters[:2].tobytes() in {codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE}:
        return LongText(_as_utf8(content, "utf-16", "replace"))
    try:
        for _ in _as_utf8(content, "utf-8", "strict"):
            pass
    except UnicodeDecodeError:
        return LongText(_as_utf8(content, "cp1252", "replace"))
    return content


def _as_utf8(content: LongText, encoding: str, errors: str) -> Iterator[bytes]:
    decoder = codecs.getincrementaldecoder(encoding)(errors)
    yield from (decoder.decode(block).encode("utf-8", "surrogatepass") for block in content.blocks())
    yield decoder.decode(b"", final=True).encode()


def program_text(path: Path | ProgramText) -> str:
    """Return the text of `program_of`, without byte order mark."""
    return str(program_of(path)).removeprefix("\ufeff")


def setup_of(
    offsets: Mapping[str, Sequence[float]],
    lengths: Mapping[int, float],
    parameters: Path | None = None,
    tools: Path | None = None,
    subprograms: Path | None = None,
    *,
    block_delete: str | None = None,
) -> ControlSetup:
    """Return the offsets and tool lengths of a control; declared ones override those of its files.

    Args:
        offsets: X, Y, Z, and A, B, C if not zero, of `G54` to `G59.3`, `G92`, `G28` and `G30` [mm, deg].
        parameters: LinuxCNC's parameter file.
        subprograms: folder of files that the program calls.
        block_delete: `on` or `off`; None: unknown.

    Raises:
        InputError: faults of the files.
        ValueError: an unknown place, or not three or six numbers.
    """
    places = {}
    for name, values in offsets.items():
        if name not in FIRST_PARAMETERS or len(values) not in {3, 6}:
            raise ValueError(
                f"{name} with {len(values)} numbers is no offset: G54 to G59.3, G92, G28, G30 have three or six"
            )
        places[name] = tuple([*map(float, values), 0.0, 0.0, 0.0][:6])
    table = {} if tools is None else tools_of(program_text(tools), str(tools))
    lengths_there = {tool: tuple(words.get(axis, 0.0) for axis in "XYZABC") for tool, words in table.items()}
    diameters = {tool: words["D"] for tool, words in table.items() if "D" in words}
    own = {tool: (0.0, 0.0, float(length), 0.0, 0.0, 0.0) for tool, length in lengths.items()}
    known = None if parameters is None else parameters_of(program_text(parameters), str(parameters))
    called = (
        {} if subprograms is None else {path.stem.lower(): path for path in sorted(subprograms.iterdir(), reverse=True)}
    )

    def subprogram(name: str) -> tuple[str, str] | None:
        return (str(called[name]), program_text(called[name])) if name in called else None

    skips = None if block_delete is None else block_delete == "on"
    return ControlSetup(
        places, lengths_there | own, diameters, parameters=known, subprogram=subprogram, block_delete=skips
    )
