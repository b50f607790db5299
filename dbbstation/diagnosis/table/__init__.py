"""Any table of measured and simulated values: where they differ, in what form, and what was left out."""
