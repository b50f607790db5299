"""What is measured: circles about balls on the jig."""
