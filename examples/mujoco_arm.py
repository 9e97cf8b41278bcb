"""Two servos inside MuJoCo hold and move an arm: with their own supply, and on four tired cells that they share."""

import sys

import numpy as np

import servotwin as st

try:
    import mujoco
except ImportError:
    print("mujoco_arm.py needs MuJoCo: pip install 'servotwin[robots]'")
    sys.exit()

ARM = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
  <body><joint name="shoulder" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .15 0 0" size=".01" mass=".1"/>
    <body pos=".15 0 0"><joint name="elbow" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 .12 0 0" size=".01" mass=".08"/><site name="tool" pos=".12 0 0"/>
    </body></body></worldbody></mujoco>"""
SERVO = st.PulseServo(st.load_servo("hitec-hs-755hb"))
CELLS = st.Supply(open_circuit_voltage=5.6, internal_resistance=0.8)
UP, DOWN = {"shoulder": 0.1, "elbow": 0.2}, {"shoulder": 1.0, "elbow": 1.2}

for name, bus in (("own supply", None), ("four tired cells", CELLS)):
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(ARM), {"shoulder": SERVO, "elbow": SERVO}, bus=bus)
    data = mujoco.MjData(drive.model)
    data.qpos[:] = list(UP.values())
    drive.record(data)
    for goals in (UP, DOWN, UP):
        drive.command(data, goals)
        drive.step(data, 1000)
    record = drive.result(data)
    up = record.time > 2.0
    ways = [np.abs(one["joint_angle"][up] - one["joint_angle"][-1]) for one in record.values()]
    late = max(float(record.time[up][np.flatnonzero(way > 0.02)[-1]]) - 2.0 for way in ways)  # rad
    print(f"{name:17} up again within {late:.2f} s; droop {np.degrees(data.qpos - list(UP.values())).round(1)} deg; "
          f"lowest bus {min(one['bus_voltage'].min() for one in record.values()):.1f} V; "
          f"peak current {max(one.peak('supply_current') for one in record.values()):.1f} A")
