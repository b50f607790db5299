"""The file that makes a folder a session; whoever only looks for sessions need not read one."""

SESSION_FILE = "session.yaml"
