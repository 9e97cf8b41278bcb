"""A joint and the gripper of an SO-101 with LeRobot's settings: droop, sag of the supply, and a trip."""

import numpy as np

import servotwin as st

LEROBOT = {"P_Coefficient": 16, "I_Coefficient": 0, "D_Coefficient": 32, "Maximum_Acceleration": 254,
           "Acceleration": 254}
GRIPPER = {"Max_Torque_Limit": 500, "Protection_Current": 250, "Overload_Torque": 25}

arm = st.feetech_sts(LEROBOT, servo="feetech-sts3215-7v4")
joint, gripper = st.DigitalServo(arm), st.DigitalServo(st.feetech_sts(GRIPPER, servo=arm))
loop = st.datasheet.Loop(joint)
held, lifted = np.degrees(loop.droop(0.2))
print(f"P 16 is {loop.stiffness:.1f} N m/rad; 0.2 N m stand {held:.1f} to {lifted:.1f} deg off")

# A joint lifts 0.2 N m: on a firm supply, through a thin cable, and where others pull the supply down to 5 V.
move = st.signals.step(-30.0, 0.0, at=0.1, unit="deg")
load = st.loads.Constant(0.2) + st.loads.Inertia(2e-3)
for words, V, R in (("firm supply", 7.4, 0.0), ("cable of 1 ohm", 7.4, 1.0), ("others pull it down", 5.0, 1.0)):
    supply = {"supply.open_circuit_voltage": V, "supply.internal_resistance": R}
    lifts = st.simulate(st.DigitalServo(arm.replace(supply)), move, duration=1.5, load=load)
    low, error = lifts["bus_voltage"].min(), -np.degrees(lifts["output_angle"][-1])
    print(f"{words}: {low:.2f} V at least, {error:.2f} deg below its goal")

# The gripper is pushed open for 3.5 s, and let go.
push = st.loads.Recorded(time=[0.0, 0.5, 0.7, 4.0, 4.01, 6.0], torque=[0.0, 0.0, 2.0, 2.0, 0.0, 0.0])
result = st.simulate(gripper, st.signals.constant(0.0, unit="deg"), duration=6.0, load=push + st.loads.Inertia(2e-4))
for kind, time in result.remarks:
    print(f"{kind} at {time:.2f} s")
for event in result.events:
    if "trip" in event.kind:
        print(f"{event.time:.2f} s: {event.kind}, {np.degrees(event.value):.1f} deg")
pushed, end = np.degrees(result["output_angle"][[3900, -1]])
print(f"pushed to {pushed:.1f} deg, comes back to {end:.2f} deg")

figure = st.plotting.time_response(result, ["output_angle", "duty", "supply_current"])
st.plotting.save(figure, "so101.png", overwrite=True)
