"""The sequence of a measurement, independent of a screen: a table of states, and events."""
