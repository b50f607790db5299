"""The sequence of a measurement without a screen: a table of states, and events."""
