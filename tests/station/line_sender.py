"""Sends the frames of the streaming encoder at the full rate of a line, in a process of its own; what the other end does not take is lost.

A line does not wait: bytes that find the system's buffer full are dropped and counted, as an UART drops them.

    python line_sender.py FD BAUD SECONDS
"""

from __future__ import annotations

import json
import os
import sys
import time

BITS = 10
"""Of a character: start, eight, stop."""

MODULUS = 100_000
OUTSIDE_S = 2.0
"""The bar stands at the feed-in point so long before it comes onto the circle."""


def frame(counter: int, length_mm: float) -> bytes:
    return f"{counter:05d},{length_mm:+011.5f},A\r\n".encode()


def main(handle: int, baud: int, seconds: float) -> None:
    os.set_blocking(handle, False)
    per_s = baud / BITS
    size = len(frame(0, 150.0))
    outside = int(OUTSIDE_S * per_s / size)
    first = b"".join(frame(k % MODULUS, 151.5) for k in range(outside))
    later = b"".join(frame(k % MODULUS, 150.0 + 1e-5 * (k % 997)) for k in range(outside, outside + MODULUS))
    total = int(seconds * per_s / size) * size
    sent = dropped = 0
    begun = time.monotonic()
    latest_s = 0.0
    while sent < total:
        now = time.monotonic() - begun
        due = min(int(now * per_s), total)
        latest_s = max(latest_s, (due - sent) / per_s)
        while sent < due:
            chunk = first[sent:due] if sent < len(first) else None
            if chunk is None:
                at = (sent - len(first)) % len(later)
                chunk = later[at : at + due - sent]
            try:
                taken = os.write(handle, chunk)
            except BlockingIOError:
                taken = 0
            # A system call may take a part of a chunk and the rest at once; nothing taken means that the buffer is full.
            if taken == 0:
                dropped += len(chunk)
                taken = len(chunk)
            sent += taken
        time.sleep(0.001)
    took_s = time.monotonic() - begun
    told = {"frames": total // size, "dropped_bytes": dropped, "seconds": took_s, "latest_s": latest_s}
    sys.stdout.write(json.dumps(told) + "\n")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))
