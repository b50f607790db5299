"""Texts of causes, digits of numbers, sorting, and safe output to a terminal."""
