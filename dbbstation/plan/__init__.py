"""Test plans: circles about balls on the jig."""
