"""`dbbstation compensate`: any NC program through the inverse of a calibrated model."""

from __future__ import annotations

from dbbstation.cli.declared import command
from dbbstation.cli.programs import print_programs
from dbbstation.tasks.compensate import compensate as task

compensate = command(task, print_programs)
