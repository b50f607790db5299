"""Figures of measured circles without a model, after ISO 230-4, each with its uncertainty. Pure mathematics."""
