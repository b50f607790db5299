"""`dbb-job/1`: a measurement that an operator repeats, with everything that was decided in advance."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from dbbstation.errors import Problem
from dbbstation.facts.quantities import Ordinal, Text
from dbbstation.files.formats.bar import parse_bar
from dbbstation.files.formats.machine import parse_machine
from dbbstation.files.formats.plan import parse_plan
from dbbstation.files.formats.settings_schema import ToleranceSettings
from dbbstation.files.source_text import without_faults
from dbbstation.files.yaml.schema import Schema, read_valid
from dbbstation.files.yaml.text import YamlDocument
from dbbstation.system.ports import FASTEST, SLOWEST, misspelt, time_scale_of, virtual_port

MayChange = Literal["operator", "order", "port", "temperature"]
"""Choices that may be left to the operator."""


class JobFile(Schema):
    """A measurement with its plan, machine, instrument and limits, and with the operator's choices."""

    format: Literal["dbb-job/1"]
    """Name and version of this format."""
    name: Text
    """Name of the job for the operator."""
    plan: Text
    """The plan, a path from this file's folder."""
    machine: Text
    """The nominal machine, likewise."""
    instrument: Text
    """Name of the instrument, or its protocol file."""
    profile: str = ""
    """Its variant; absent: the usual one."""
    port: Text
    """Name or URL of the port; `virtual machine` tries the job without hardware."""
    baud: Ordinal | None = None
    """Baud rate, if the instrument is not set to the usual one [1/s]."""
    bar: str = ""
    """Calibration of the bar, a path from this file's folder."""
    bar_waiver: str = ""
    """Reason for measuring without this file; a real port needs one of both."""
    sessions: str = "."
    """Folder of the job's sessions, a path from this file's folder."""
    serial_number: str = ""
    """Serial number of the machine."""
    operator: str = ""
    """The operator, if always the same."""
    order: str = ""
    """Order number, if always the same."""
    place: str = ""
    """Place of the measurement, for a certificate."""
    model: str = ""
    """Model of the machine, a path from this file's folder; the report compares the circles with it."""
    trouble: str = ""
    """Text for the operator if a limit is exceeded or the station cannot continue, such as whom to call."""
    required: tuple[Literal["operator", "order", "temperature"], ...] = ()
    """Facts that the operator must state before a session."""
    tolerances: Annotated[tuple[ToleranceSettings, ...], Field(min_length=1)]
    """Tolerances of the circles."""
    may_change: tuple[MayChange, ...] = ()
    """The only choices of the operator before a session."""


def read_job(path: Path) -> JobFile:
    """Read a job.

    Raises:
        InputError: every fault of it and its files.
    """
    return without_faults(parse_job, path)


def parse_job(path: Path, faults: list[Problem]) -> JobFile | None:
    """Read a job and its files; None with faults added to `faults`."""
    read = read_valid(path, JobFile, faults)
    if read is None:
        return None
    document, job = read
    plan = parse_plan(path.parent / job.plan, faults)
    parse_machine(path.parent / job.machine, faults)
    if job.bar:
        parse_bar(path.parent / job.bar, faults)
    if job.model and not (path.parent / job.model).is_file():
        document.fault(("model",), f"there is no file {job.model}", "check the path")
    if job.bar and job.bar_waiver:
        document.fault(("bar_waiver",), "a bar and why there is none", "leave one of both out")
    if misspelt(job.port):
        what = f"`{job.port}` is no virtual machine"
        names = f"write `{virtual_port()}`, or `{virtual_port(10.0)}`, with {SLOWEST:g} to {FASTEST:g} in place of 10"
        document.fault(("port",), what, names)
    if not (job.bar or job.bar_waiver or time_scale_of(job.port)):
        document.fault(("bar",), "neither a bar nor why there is none", "name its file, or say why in `bar_waiver`")
    if plan is not None:
        _check_tests(document, job, set(plan.to_domain().tests))
    return job


def _check_tests(document: YamlDocument, job: JobFile, tests: set[str]) -> None:
    for place, tolerance in enumerate(job.tolerances):
        for unknown in sorted(set(tolerance.tests) - tests):
            known = ", ".join(sorted(tests))
            what = f"the plan has no test `{unknown}`"
            document.fault(("tolerances", place, "tests"), what, f"it has {known}")
