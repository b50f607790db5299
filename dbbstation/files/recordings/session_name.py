"""Names of files and folders in a session folder."""

from dbbstation.files import recorded_ground

SESSION_FILE = recorded_ground.SESSION_FILE
"""File that marks a session folder."""

MACHINE_FILE, PLAN_FILE, RUNS, PROGRAMS = "machine.yaml", "plan.yaml", "runs", "programs"
"""Other names in a session of this program."""
