"""Corrections inside a control: a LinuxCNC kinematics generated from a model, or parameters of genhexkins."""
