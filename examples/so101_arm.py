"""An SO-101 class arm in MuJoCo, six STS3215 on one supply: it reaches out, waits, and is sent into the table."""

import sys
from pathlib import Path

import numpy as np

import servotwin as st

try:
    import mujoco  # noqa: F401 - to say what is missing
except ImportError:
    print("so101_arm.py needs MuJoCo: pip install 'servotwin[robots]'")
    sys.exit()

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
GRIPPER = {"Max_Torque_Limit": 500, "Protection_Current": 250, "Overload_Torque": 25}


def eased(time, begin, end):
    """Go from 0 to 1 between two times."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip((time - begin) / (end - begin), 0.0, 1.0))


time = np.linspace(0.0, 7.0, 351)
out, down = eased(time, 0.5, 1.5), eased(time, 2.5, 3.5)
goals = {"shoulder_pan": 20.0 * out, "shoulder_lift": -60.0 + 60.0 * out + 60.0 * down, "elbow_flex": 60.0 - 50.0 * out,
         "wrist_flex": 20.0 * out, "wrist_roll": 0.0 * time, "gripper": 10.0 + 30.0 * out}
np.savetxt("reach.csv", np.column_stack([time, *goals.values()]), delimiter=",", comments="",
           header=",".join(["time_s", *(f"{name}_deg" for name in goals)]))
motion = st.robots.read_motion(Path("reach.csv"), JOINTS)

registers = {"P_Coefficient": 16, "D_Coefficient": 32, "I_Coefficient": 0}  # LeRobot's
servos = {name: st.DigitalServo(st.feetech_sts(registers | (GRIPPER if name == "gripper" else {}),
                                               servo="feetech-sts3215-12v")) for name in JOINTS}
for supply in (st.Supply(open_circuit_voltage=12.0, internal_resistance=0.1),
               st.Supply(open_circuit_voltage=12.0, internal_resistance=1.0)):
    run = st.robots.run_motion("so101", servos, motion, bus=supply, assume_heat=False)
    held = (run.time > 2.0) & (run.time < 2.5)
    lift = run.record["shoulder_lift"]
    droop = np.degrees(np.mean(lift["joint_angle"][held] - lift["joint_command"][held]))
    trips = [f"{name} {one.kind} at {one.time:.1f} s" for name, record in run.record.items() for one in record.remarks]
    print(f"12 V behind {supply.internal_resistance} ohm: shoulder_lift droops {droop:.1f} deg held out, "
          f"supply down to {lift['bus_voltage'].min():.1f} V; {'; '.join(trips) or 'no trips'}")
