"""A virtual instrument with faults of lines and devices."""

from __future__ import annotations

import tempfile
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.virtual.wire import VirtualInstrument

if TYPE_CHECKING:
    from collections.abc import Callable


class FaultyInstrument(VirtualInstrument):
    """The same, until a fault is asked for.

    A pseudo-terminal has a name of its own, which ends with it: the system gives `/dev/pts/N` to whoever asks next, and
    a program that connects again would read the instrument of another test.
    """

    def __init__(self, *args, **more) -> None:
        super().__init__(*args, **more)
        self._silent = False
        self._parity_shows = False
        self._sampling = False
        self._to_cut: int | None = None
        self._silent_after_cut = False
        self._to_drop = 0
        self._damage: Callable[[bytes], bytes] | None = None
        self._named: Path | None = None

    def start(self) -> None:
        super().start()
        if self.port.startswith("/dev/"):
            self._named = Path(tempfile.mkdtemp()) / "instrument"
            self._named.symlink_to(self.port)
            self.port = str(self._named)

    def stop(self) -> None:
        if self._named is not None:
            self._named.unlink()
            self._named.parent.rmdir()
            self._named = None
        super().stop()

    def go_silent(self) -> None:
        """Send nothing after the current frame, as if switched off."""
        with self._lock:
            self._silent = True
            self._outgoing = deque(frame for frame in self._outgoing if frame.sent)

    def speak_again(self) -> None:
        """End the silence."""
        with self._lock:
            self._silent = False

    def hang_up(self) -> None:
        """Close the line in use, as if unplugged."""
        self.stop()

    def send_garbage(self, raw: bytes) -> None:
        """Send noise bytes."""
        with self._lock:
            self._send(raw, self.clock())

    def cut_next_frame(self, keep: int, *, then_silent: bool = False) -> None:
        """Send only `keep` bytes of the next frame, then nothing with `then_silent`."""
        with self._lock:
            self._to_cut, self._silent_after_cut = keep, then_silent

    def damage_next_frame(self, damage: Callable[[bytes], bytes]) -> None:
        """Send the next frame changed by `damage`; may be called in `length_mm_at`."""
        self._damage = damage

    def drop_samples(self, count: int) -> None:
        """Skip samples; the counter goes on."""
        with self._lock:
            self._to_drop += count

    def show_parity(self) -> None:
        """Put even parity into the eighth bit, as 8 data bits see 7 with parity."""
        with self._lock:
            self._parity_shows = True

    def _send_sample(self, at_s: float, start_s: float) -> None:
        if self._to_drop:
            self._to_drop -= 1
            self._counter += 1
            return
        self._sampling = True
        super()._send_sample(at_s, start_s)
        self._sampling = False

    def _send(self, raw: bytes, start_s: float) -> None:
        cut = self._sampling and self._to_cut is not None
        if self._sampling and self._damage is not None:
            raw, self._damage = self._damage(raw), None
        if cut:
            raw, self._to_cut = raw[: self._to_cut], None
        if self._silent:
            return
        if self._parity_shows:
            raw = bytes(byte | (byte.bit_count() % 2) << 7 for byte in raw)
        super()._send(raw, start_s)
        if cut:
            self._silent = self._silent_after_cut
