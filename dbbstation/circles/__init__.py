"""Figures of measured circles by ISO 230-4, with uncertainties, without a model."""
