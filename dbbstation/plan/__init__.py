"""What is to be measured: circles about balls on the jig, and whether the machine can run them. Pure mathematics."""
