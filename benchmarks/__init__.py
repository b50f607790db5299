"""Performance, each measured against a peer in the same run; scripts to be run by hand."""
