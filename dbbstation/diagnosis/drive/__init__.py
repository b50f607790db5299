"""Identify one drive: mass, friction, missing physics."""
