"""Compare a simulator with recordings: refit it, insert terms at ports."""
