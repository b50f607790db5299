"""NC programs: read, written in a dialect, compensated. Text in, text out: files are the command line's business."""
