"""Fit and judge models of one measured channel; independent of hexapods."""
