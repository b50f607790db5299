"""Figures of measured circles after ISO 230-4, with uncertainties, without a model."""
