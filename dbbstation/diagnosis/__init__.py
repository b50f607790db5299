"""Find what a model lacks: detect, locate, name, propose tests."""
