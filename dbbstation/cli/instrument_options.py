"""Options of real instruments: which, where, line rate."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.number_types import Finite
from dbbstation.cli.shop import shop_option

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dbbstation.instrument.bytelog import ByteLog
    from dbbstation.instrument.protocol import Protocol

_Function = TypeVar("_Function", bound="Callable[..., Any]")


def protocol_options(*, required: bool) -> Callable[[_Function], _Function]:
    """Give a command `--instrument`, `--profile` and `--zero-mm`; the first is required unless set by the shop."""
    return _given(
        shop_option(
            "--instrument",
            setting="instrument",
            required=required,
            metavar="NAME",
            help="Name of an instrument (`dbbstation instrument list`), or a protocol file.",
        ),
        shop_option(
            "--profile",
            setting="profile",
            goes_with="instrument",
            metavar="NAME",
            help="Variant of the instrument, such as its firmware or resolution (`dbbstation instrument list NAME`).",
        ),
        click.option(
            "--zero-mm",
            type=Finite(20.0, 2000.0),
            help="Distance between the ball centres at zero of a short display [mm].",
        ),
    )


def instrument_options(*, required: bool) -> Callable[[_Function], _Function]:
    """Give a command `protocol_options`, `--port` and `--baud`; required unless set by the shop."""
    of_protocol = protocol_options(required=required)
    of_line = _given(
        shop_option(
            "--port",
            setting="port",
            required=required,
            help="Port name, or a URL such as socket://127.0.0.1:4001 or rfc2217://127.0.0.1:4001.",
        ),
        shop_option(
            "--baud",
            setting="baud",
            type=click.IntRange(min=1),
            help="Baud rate, if the instrument is not set to the usual one.",
        ),
    )
    return lambda function: of_protocol(of_line(function))


def spy_option(function: _Function) -> _Function:
    """Give a command `--spy FILE`."""
    option = click.option(
        "--spy",
        type=click.Path(dir_okay=False, path_type=Path),
        help="Write every byte of the line with its time into this new file, for `instrument replay`.",
    )
    return option(function)


def chosen_protocol(
    instrument: str, profile: str | None, zero_mm: float | None, *, bar_length_mm: float | None = None
) -> Protocol:
    """Return the protocol of the options.

    Raises:
        InstrumentError: unknown instrument or profile, or a relative one without zero.
        InputError: faults of the protocol file.
    """
    from dbbstation.instrument.library import load_instrument, with_zero

    protocol = load_instrument(instrument, profile)
    if zero_mm is None and protocol.length.relative:
        zero_mm = bar_length_mm
    return with_zero(protocol, zero_mm)


@contextmanager
def spying(path: Path | None, protocol: Protocol, port: str, *, force: bool = False) -> Iterator[ByteLog | None]:
    """Open a byte log if requested.

    Raises:
        OutputError: the file exists, lies in a session, or cannot be written.
    """
    from dbbstation.files.recorded_ground import refuse_recorded
    from dbbstation.instrument.bytelog import ByteLog

    if path is None:
        yield None
        return
    refuse_recorded(path)
    with ByteLog(path, instrument=protocol.name, profile=protocol.profile, port=port, force=force) as log:
        yield log


def _given(*options: Callable[[_Function], _Function]) -> Callable[[_Function], _Function]:
    def give(function: _Function) -> _Function:
        for option in reversed(options):
            function = option(function)
        return function

    return give
