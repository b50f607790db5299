"""The command line. A command is loaded when called."""

from __future__ import annotations

import gc
import io
import os
import sys
import warnings
from typing import TYPE_CHECKING, Any

import click

from dbbstation import __version__
from dbbstation.cli.lazy import LazyGroup
from dbbstation.cli.log import drop_output, drop_unwritable, flush_output, open_missing
from dbbstation.cli.output import echo, say
from dbbstation.cli.progress import Compiling
from dbbstation.computing.compiled import tell_of_compiling
from dbbstation.errors import InputError, StationError, in_a_sentence
from dbbstation.files.inputs import input_book, open_book
from dbbstation.system.signals import politely_ended

if TYPE_CHECKING:
    from collections.abc import Sequence

DONE, FAILED, USAGE = 0, 1, 2
"""Exit codes."""

_DEBUG, _VERBOSE, _SETTINGS = "--debug", "--verbose", "--settings"

COMMANDS = {
    "bar": "Measure the bar on its calibrator, and keep its length.",
    "calibrate": "Fit the machine's errors to recorded sessions.",
    "check": "Validate files of any format, and whole sessions.",
    "circles": "Figures of measured circles after ISO 230-4, and findings.",
    "compare": "Where two sessions differ, and what the difference follows.",
    "control": "Correct inside the control: its kinematics or parameters.",
    "compensate": "Compensate any NC program with a calibrated model.",
    "diagnose": "Find the physics that a calibration leaves out.",
    "demo": "The whole job on a simulated machine, start to end.",
    "evaluate": "Residuals of recordings under a model, circle by circle.",
    "export": "Sessions as one tidy table, CSV or Parquet.",
    "fleet": "One task on many sessions; which machines differ.",
    "history": "A folder of sessions as trends, and what changed.",
    "identify": "One strut drive: mass, friction, further causes.",
    "import": "Import recordings of another program into a session.",
    "instrument": "Instruments: list, ports, monitor, replay, emulate.",
    "jig": "A jig file from a CMM sheet; how well holders repeat.",
    "measure": "Measure a plan on a screen or in lines, into a session.",
    "mismatch": "Where any simulation and any recording differ, and how.",
    "predict": "Actual poses for commanded ones, under a model.",
    "program": "NC programs of a plan's circles, nominal or compensated.",
    "report": "A session as one HTML file: verdict, figures with U.",
    "settings": "The shop's settings, and where each value comes from.",
    "session": "Runs of a session afterwards: list, accept, reject, seal.",
    "simulate": "Noise-free recordings of a plan, as a model predicts them.",
    "sources": "The known causes of error, and how to confirm them.",
}
"""Name and one line of help of every command. Its module has its name, apart from those in `_MODULES`."""

_MODULES = {
    "compensate": "programs.compensate",
    "instrument": "instruments.instrument",
    "program": "programs.program",
    "simulate": "predict.simulate",
}


@click.group(
    "dbbstation",
    cls=LazyGroup,
    table=COMMANDS,
    package="dbbstation.cli",
    modules=_MODULES,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(__version__, prog_name="dbbstation")
@click.option(
    _SETTINGS,
    metavar="FILE",
    help="Read the shop's settings from this file alone; allowed anywhere on the line.",
)
@click.option(
    _VERBOSE,
    is_flag=True,
    help="Show the log on standard error too; allowed anywhere on the line.",
)
@click.option(_DEBUG, is_flag=True, help="Show the traceback of an error; allowed anywhere on the line.")
def cli(*, settings: str | None, verbose: bool, debug: bool) -> None:  # noqa: ARG001 - read from the line before
    """Measure a hexapod machine tool with a double ball bar, calibrate it, find what its model lacks.

    \b
    Start here:
      dbbstation demo                                  the whole job on a simulated machine
      dbbstation calibrate SESSION --out model.yaml    fit the errors of a recorded machine
      dbbstation COMMAND --help                        what a command does, with examples
    """  # noqa: D301 - \b is click's mark for "do not wrap"
    if settings is not None and not os.path.isfile(settings):  # noqa: PTH113 - before anything else is imported
        raise InputError.of(settings, "there is no such file", "check the path")


NEW_OBJECTS = 200_000
"""New objects after which Python looks for unreachable ones; its own 700 take 0.4 of 2.3 s of `check`, because a command
imports 150,000. The peak memory of `check`, `report` and `diagnose` is the same without any collection."""


def _begun(arguments: Sequence[str] | None) -> list[str]:
    """Prepare the process, and return its arguments."""
    open_missing()
    # All work of this process is the program's own: the threads that `dbbstation.computing.threads` takes away are not even started.
    # Read when NumPy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    warnings.showwarning = _noted
    tell_of_compiling(Compiling())
    if arguments is not None:
        return list(arguments)
    gc.set_threshold(NEW_OBJECTS)  # the process is this command's alone
    return sys.argv[1:]


def main(arguments: Sequence[str] | None = None, group: click.Group = cli) -> None:
    """Run the command line, or another group of commands, and exit with its code."""
    given, code = _begun(arguments), FAILED
    debug = _DEBUG in given
    try:
        # Not `cli.main`, which answers Ctrl-C with an empty line of its own.
        with (
            politely_ended(),
            input_book(),
            group.make_context(group.name, _own_first(given), obj=tuple(given)) as context,
        ):
            done = _invoked(group, context)
            if virtual := tuple(open_book().virtual):
                echo(f"VIRTUAL MACHINE: {', '.join(virtual)}: computed, and not measured on a real machine", err=True)
            flush_output()
            code = done if isinstance(done, int) else DONE
    except click.exceptions.Exit as left:
        code = left.exit_code
    except click.ClickException as problem:
        told = io.StringIO()
        problem.show(told)
        echo(told.getvalue(), err=True, nl=False)
        code = problem.exit_code
    except (click.Abort, KeyboardInterrupt):
        # A terminal shows ^C where the cursor stands.
        echo(("\n" if sys.stderr.isatty() else "") + "interrupted; files that were already written are kept", err=True)
    except BrokenPipeError:
        # Whoever read the output has seen enough, as `| head` does.
        drop_output()
    except (StationError, OSError) as problem:
        if debug:
            raise
        drop_unwritable()
        echo(in_a_sentence(problem) if isinstance(problem, OSError) else str(problem), err=True)
    except Exception as problem:
        if debug:
            raise
        echo(f"{type(problem).__name__}: {problem}", err=True)
        echo(f"this is a fault of dbbstation itself; {_DEBUG} shows what to report", err=True)
    sys.exit(code)


def _invoked(group: click.Group, context: click.Context) -> object:
    try:
        return group.invoke(context)
    except SystemExit as left:
        what = f"code that a file brings ended the program, with {left.code!r}"
        raise StationError(what, remedy="raise an error in it instead of calling sys.exit") from left


_SHOWN_BY_PYTHON = warnings.showwarning


def _noted(message: Warning | str, category: type[Warning], *where: Any, **further: Any) -> None:  # noqa: ANN401 - passed on
    from dbbstation.computing.compiled import NotKeptWarning

    if issubclass(category, NotKeptWarning):
        say(f"note: {message}")
    else:
        _SHOWN_BY_PYTHON(message, category, *where, **further)


def _own_first(given: list[str]) -> list[str]:
    own, others = [], list[str]()
    arguments = iter(given)
    for argument in arguments:
        if argument in {_DEBUG, _VERBOSE} or argument.startswith(f"{_SETTINGS}="):
            own.append(argument)
        elif argument == _SETTINGS:
            own += [argument, *[file for file in [next(arguments, None)] if file is not None]]
        else:
            others.append(argument)
    return [*own, *others]
