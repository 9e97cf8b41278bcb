"""A servo driven against a stop: how its torque falls as it warms up, and when its winding is too hot."""

import numpy as np

import servotwin as st

DURATION = 60.0  # s
LIMIT = 130.0  # deg C, class B of IEC 60085; assumed, as the class of a servo's wire is not published
servo = st.load_servo("hitec-hs-755hb").replace({  # assumed: about 5 g of copper, 60 g of motor, 20 s and 8 min
    "thermal.winding_capacity": 2.0, "thermal.housing_capacity": 30.0, "thermal.winding_to_housing": 10.0,
    "thermal.housing_to_ambient": 16.0, "thermal.magnet_coefficient": -0.0015,
    "stops.upper_angle": np.radians(90.0)})
command = st.signals.constant(2200.0, unit="us")
start = {"output_angle": np.radians(90.0)}

hot, weak = [], []
for voltage in (4.8, 6.0, 7.4):  # the sheet ends at 6 V; 7.4 V are two lithium cells
    model = st.PulseServo(servo.replace({"supply.open_circuit_voltage": voltage}))
    result = st.simulate(model, command, duration=DURATION, output_step=0.1, initial=start)
    celsius = result["winding_temperature"] - 273.15
    torque = model.value("gear.gear_reduction") * result["motor_torque"]
    reached = celsius >= LIMIT
    when = f"{result.time[np.argmax(reached)]:.0f} s" if reached.any() else f"not within {DURATION:.0f} s"
    print(f"{voltage} V: {torque[10]:.2f} N m at first, {torque[-1]:.2f} N m at {celsius[-1]:.0f} deg C; "
          f"{LIMIT:.0f} deg C: {when}")
    hot.append(st.plotting.Curve(f"{voltage} V", result.time[10:], celsius[10:]))
    weak.append(st.plotting.Curve(f"{voltage} V", result.time[10:], torque[10:]))
figure = st.plotting.curves(hot, x_label="time against the stop (s)", y_label="winding (°C)", below=weak,
                            below_label="torque (N m)", limits=[st.plotting.Limit("class B", LIMIT)], height=4.2)
st.plotting.save(figure, "stall.png", overwrite=True)
