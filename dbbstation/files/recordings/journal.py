"""The journal of a run: samples are written on arrival, and synced once a second.

Each line has its CRC-32, because a power cut may mix pages.
"""

from __future__ import annotations

import logging
import math
import os
import time
import zlib
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, OutputError, refusal, unwritable
from dbbstation.files.atomic import set_read_only
from dbbstation.files.formats.session import PART
from dbbstation.files.gateway import digest_of
from dbbstation.files.recordings.run_csv import RunFile, parse_run
from dbbstation.system.handles import Closing, read_at
from dbbstation.system.replacing import rename, sync_folder
from dbbstation.trace import columns

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from dbbstation.files.formats.session import Counts
    from dbbstation.plan.plan import Direction

_LOG = logging.getLogger(__name__)

_MANY = 1000

SYNC_INTERVAL_S = 0.5
"""Time between two syncs [s], so short that each sample is on the disk within a second, despite batches and the sync's own time."""


def run_name(test: str, direction: Direction, repeat: int) -> str:
    """Return the file name of a sealed run."""
    return f"{test}-{direction}-{repeat}.csv"


def run_header(test: str, direction: Direction, repeat: int, names: Sequence[str]) -> bytes:
    """Return the first lines of a run file.

    Raises:
        ValueError: an unknown column, or a required one is missing.
    """
    unknown = [name for name in names if name not in columns.COLUMNS and name != columns.STATUS]
    missing = [name for name in columns.REQUIRED if name not in names]
    if unknown or missing:
        raise ValueError(f"a run cannot have the columns {unknown}, and it lacks the columns {missing}")
    top = f"# test: {test}\n# direction: {direction}\n# repeat: {repeat}\n"
    return (top + ",".join([*names, columns.CRC]) + "\n").encode()


def run_foot(counts: Counts) -> bytes:
    """Return the last lines of a sealed run file, which contain its counts.

    A run file without these lines was interrupted.
    """
    lines = [f"# received: {counts.received}", f"# lost: {counts.lost}"]
    lines += [f"# rejected {reason}: {count}" for reason, count in counts.rejected.items()]
    return ("\n".join(lines) + "\n").encode()


def run_line(values: Sequence[float | str], names: Sequence[str], *, exact: bool = False) -> bytes:
    """Return one line of a run file with its checksum.

    Args:
        names: without the checksum.
        exact: write as many digits as read back the same bits.

    Raises:
        ValueError: a number is not finite, or a text has a comma or line end.
    """
    fields = []
    for name, value in zip(names, values, strict=True):
        if isinstance(value, str):
            if any(character in value for character in ",\r\n\0"):
                raise ValueError(f"{name} cannot hold {value!r}")
            fields.append(value)
            continue
        if not math.isfinite(value):
            raise ValueError(f"{name} is {value}; every sample of a run needs a value")
        fields.append(repr(value) if exact else f"{value:.{columns.COLUMNS[name].decimals}f}")
    body = ",".join(fields).encode()
    return body + f",{zlib.crc32(body):08x}\n".encode()


class RunWriter(Closing):
    """Appends samples to one run. Leaving the context keeps the `.part` unless sealed.

    Args:
        names: in order, without the checksum, with `t_s` and `length_mm`.

    Raises:
        OutputError: the run exists already, or its file cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        test: str,
        direction: Direction,
        repeat: int,
        names: Sequence[str],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.names = tuple(names)
        self.sealed_path = folder / run_name(test, direction, repeat)
        self.path = self.sealed_path.with_name(self.sealed_path.name + PART)
        self.samples = 0
        self._clock = clock
        self._last_t_s = -math.inf
        self._time_at = self.names.index(columns.TIME)
        header = run_header(test, direction, repeat, names)
        self._refuse_sealed()
        with self._told():
            self._begin(header)
        self._synced_at = clock()

    def append(self, values: Sequence[float | str]) -> None:
        """Write one sample, and sync if the last sync is old.

        Raises:
            OutputError: the disk refuses; earlier samples stay.
            ValueError: a value is not finite, or time does not rise.
        """
        line = run_line(values, self.names)
        t_s = float(line.split(b",")[self._time_at])
        if t_s <= self._last_t_s:
            raise ValueError(f"t_s must rise: {t_s} after {self._last_t_s}")
        with self._told():
            self._write(line)
        self._last_t_s = t_s
        self.samples += 1
        self.sync_if_due()

    def sync_if_due(self) -> None:
        """Sync if the last sync is old. Call this also while no samples arrive."""
        if self._clock() - self._synced_at >= SYNC_INTERVAL_S:
            self.sync()

    def sync(self) -> None:
        """Sync to disk, unless the file is closed.

        Raises:
            OutputError: the disk refuses.
        """
        if self._file.closed:
            return
        with self._told():
            os.fsync(self._file.fileno())
            self._put_back()
        self._synced_at = self._clock()

    def _put_back(self) -> None:
        try:
            there = self.path.lstat()
        except FileNotFoundError:
            there = None
        if there is not None and os.path.samestat(there, os.fstat(self._file.fileno())):
            return
        lost, data = self._file, self._content()
        if there is not None:
            # Another file stands in its place: it keeps what it holds, under a name that is free.
            number = next(k for k in range(1, _MANY) if not os.path.lexists(self._foreign(k)))
            rename(self.path, self._foreign(number))
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._begin(data)
        lost.close()
        _LOG.warning("%s was removed while it was recorded, and is written anew: nothing is lost", self.path)

    def _refuse_sealed(self) -> None:
        if self.sealed_path.exists():
            raise OutputError("this run exists already", where=str(self.sealed_path), remedy="take the next repeat")

    def _begin(self, data: bytes) -> None:
        # Unbuffered: a killed program loses nothing, only a power cut can.
        self._file = self.path.open("x+b", buffering=0)
        self._write(data)
        os.fsync(self._file.fileno())
        sync_folder(self.path.parent)

    def _foreign(self, number: int) -> Path:
        return self.path.with_name(f"{self.path.name}.foreign-{number}")

    def _content(self) -> bytes:
        handle = self._file.fileno()
        data = read_at(handle, os.fstat(handle).st_size, 0)
        os.lseek(handle, 0, os.SEEK_END)
        return data

    def read(self) -> RunFile:
        """Read the samples back.

        Raises:
            InputError: it cannot be read, or was altered.
        """
        try:
            data = self._content()
        except OSError as error:
            why, remedy = refusal(error)
            raise InputError.of(self.path, f"cannot be read: {why}", remedy) from error
        return parse_run(data, str(self.path))

    def seal(self, counts: Counts | None = None) -> str:
        """Sync, hash and rename the run; return its SHA-256.

        Args:
            counts: written below the samples; None: not known.

        Raises:
            OutputError: no sample, a taken name, or the disk refuses; the `.part` stays.
        """
        if not self.samples:
            raise OutputError("no sample was recorded", where=str(self.path), remedy="check the instrument's line")
        if counts is not None:
            with self._told():
                self._write(run_foot(counts))
        self.sync()
        self.close()
        with self._told():
            digest = digest_of(self.path)
            self._refuse_sealed()
            set_read_only(self.path)
            rename(self.path, self.sealed_path)
            sync_folder(self.sealed_path.parent)
        return digest

    def close(self) -> None:
        """Close the file; an unsealed one remains a `.part`."""
        self._file.close()

    def _write(self, line: bytes) -> None:
        left = memoryview(line)
        while left:
            left = left[self._file.write(left) :]

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except FileExistsError as error:
            what = "this run is being recorded, or was when the station died"
            raise OutputError(what, where=str(self.path), remedy="take the next repeat") from error
        except OSError as error:
            raise unwritable(error, self.path) from error
