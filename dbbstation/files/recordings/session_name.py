"""Names in a session folder."""

from dbbstation.files import recorded_ground

SESSION_FILE = recorded_ground.SESSION_FILE
"""What a session folder is known by."""

MACHINE_FILE, PLAN_FILE, RUNS, PROGRAMS = "machine.yaml", "plan.yaml", "runs", "programs"
"""What stands beside it in a session that this program makes."""
