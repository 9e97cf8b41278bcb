"""A pendulum on a hobby servo as an FMU, stepped by a tool for co-simulation that pushes it now and then."""

import tempfile
from pathlib import Path

import servotwin as st

try:
    import fmpy
    from fmpy.fmi2 import FMU2Slave
except ImportError:
    raise SystemExit("fmpy is not installed: pip install fmpy") from None

with tempfile.TemporaryDirectory() as folder:
    servo = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    path = st.export.fmu(servo, st.loads.Pendulum(mass=0.1, length=0.12)).write(Path(folder) / "pendulum.fmu")
    about = fmpy.read_model_description(str(path))
    reference = {each.name: each.valueReference for each in about.modelVariables}
    tool = FMU2Slave(guid=about.guid, unzipDirectory=fmpy.extract(str(path), unzipdir=f"{folder}/unpacked"),
                     modelIdentifier=about.coSimulation.modelIdentifier, instanceName="arm")
    tool.instantiate()
    tool.setupExperiment(startTime=0.0)
    tool.enterInitializationMode()
    tool.exitInitializationMode()
    tool.setReal([reference["pulse_width"]], [1.6e-3])
    print("time s   angle rad   current A   push N m")
    for k in range(100):
        push = 0.3 if 60 <= k < 80 else 0.0
        tool.setReal([reference["external_torque"]], [push])
        tool.doStep(0.01 * k, 0.01)
        if k % 10 == 9:
            angle, current = tool.getReal([reference["output_angle"], reference["armature_current"]])
            print(f"{0.01 * (k + 1):6.2f} {angle:11.4f} {current:11.3f} {push:10.1f}")
    tool.terminate()
    tool.freeInstance()
