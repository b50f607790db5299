"""An NC dialect: LinuxCNC's words in files with another ending."""

from dbbstation.nc.dialects.linuxcnc import LinuxCNC


class ExampleControl(LinuxCNC):
    """What differs from LinuxCNC is written here as methods of the same names."""

    name = "example-control"
    extension = ".exa"
    what = "a control that reads LinuxCNC's words"
