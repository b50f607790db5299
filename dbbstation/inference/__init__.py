"""Fit and judge models of one measured channel, without knowledge of hexapods."""
