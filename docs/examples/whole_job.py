"""The calculations of `dbbstation demo` from Python, on the sessions that it leaves: `python whole_job.py` in its folder."""

import dbbstation as dbb

measured = dbb.load("measured")
kinematic = dbb.calibrate(measured)
joint = dbb.diagnose(measured)
before = dbb.evaluate(measured, joint)
after = dbb.evaluate("verified", joint)

print(f"kinematic calibration leaves {kinematic.residual_within_mounting_rms_um:.2f} µm rms within mountings")
for cause in joint.identified:
    for name, number in cause.parameters.items():
        print(f"{cause.name}: {name} {number.value:.4g}, u {number.uncertainty:.2g} {number.unit}")

later = {(run.test, run.direction): run.measured for run in after.runs}
for run in before.runs:
    if run.direction == "ccw":
        um = [of.centre_deviation_um for of in (run.measured, later[run.test, run.direction])]
        print(f"{run.test}: centre deviation {um[0]:.1f} -> {um[1]:.1f} µm")

dbb.write_model("from-python.yaml", joint, force=True)
