"""Print the points of moves at feed in LinuxCNC's preview of a program [mm]: run by the Python of the system, which has its module `gcode`."""

import json
import sys
import tempfile

import gcode

MM_PER_INCH = 25.4


class Canon:
    """What the preview calls; most calls mean nothing here."""

    def __init__(self, folder):
        self.points, self.parameter_file = [], f"{folder}/rs274.var"
        self.system, self.shift = [0.0] * 3, [0.0] * 3

    def __getattr__(self, name):
        if name.startswith("_"):
            raise AttributeError(name)
        return lambda *_arguments: None

    def straight_feed(self, *pose):
        inches = zip(pose[:3], self.system, self.shift, strict=True)
        self.points.append([sum(each) * MM_PER_INCH for each in inches])

    def set_g5x_offset(self, _system, *offset):
        self.system = offset[:3]

    def set_g92_offset(self, *offset):
        self.shift = offset[:3]

    def get_external_length_units(self):
        return 1.0 / MM_PER_INCH

    def get_external_angular_units(self):
        return 1.0

    def get_axis_mask(self):
        return 0b111111

    def get_block_delete(self):
        return False

    def check_abort(self):
        return False

    def get_tool(self, _pocket):
        return (-1, *[0] * 13)


with tempfile.TemporaryDirectory() as folder:
    canon = Canon(folder)
    result, line = gcode.parse(sys.argv[1], canon, "G21", "")
    if result > gcode.MIN_ERROR:
        raise SystemExit(f"line {line}: {gcode.strerror(result)}")
    sys.stdout.write(json.dumps(canon.points))
