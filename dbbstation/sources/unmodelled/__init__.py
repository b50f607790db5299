"""Descriptions of errors without a known cause: curves over length or force, and waves."""
