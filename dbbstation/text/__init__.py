"""Texts of causes, decimals of numbers, sorting, and safe output to a terminal."""
