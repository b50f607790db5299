"""Findings about measured circles: number, limit, unit.

Limits follow from the run's noise, other runs and known places. A sound run has any finding with probability 0.001.
"""
