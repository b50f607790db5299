"""The sequence of a measurement without a screen: states and transitions in a table, events for storage and screens."""
