"""`dbbstation study NAME`: one module per experiment."""
