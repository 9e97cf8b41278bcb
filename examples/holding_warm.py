"""Ten minutes of holding a load: copper and magnets warm up, and the servo sags a little more."""

import numpy as np

import servotwin as st

LOOK, STEP = 0.5, 60.0  # s: heat is slow, so half a second of pulses says what heats the next minute
masses = {"winding_capacity": 2.0, "housing_capacity": 30.0, "winding_to_housing": 10.0, "housing_to_ambient": 16.0}
servo = st.load_servo("hitec-hs-755hb").replace(  # assumed: about 5 g of copper, 60 g of motor, 20 s and 8 min
    {f"thermal.{name}": value for name, value in masses.items()} | {"thermal.magnet_coefficient": -0.002})
model = st.PulseServo(servo)
command = st.signals.constant(1500.0, unit="us")

times = np.arange(0.0, 601.0, STEP)
warm, more = [], []
for torque in (0.4, 0.6):  # N m
    load = st.loads.Constant(torque)
    angle = st.simulate(model, command, duration=1.0, load=load)["output_angle"][-1]
    now, winding, sag = st.physics.Temperatures(298.15, 298.15), [], []
    for _ in times:
        start = {"output_angle": float(angle), "winding_temperature": float(now.winding),
                 "housing_temperature": float(now.housing)}
        result = st.simulate(model, command, duration=LOOK, load=load, initial=start)
        angle = result["output_angle"][-1]
        winding.append(now.winding - 273.15)
        sag.append(np.degrees(np.mean(result["command_angle"] - result["output_angle"])))
        now = st.physics.two_mass_temperatures(STEP, result.energy.winding / LOOK, now.winding, now.housing, **masses)
    print(f"{torque} N m: {winding[-1]:.0f} deg C, sag {sag[0]:.2f} deg cold, {sag[-1]:.2f} deg warm")
    warm.append(st.plotting.Curve(f"{torque} N m", times / 60.0, winding))
    more.append(st.plotting.Curve(f"{torque} N m", times / 60.0, np.array(sag) - sag[0]))
figure = st.plotting.curves(warm, x_label="time (min)", y_label="winding (°C)", below=more,
                            below_label="more sag (°)", height=4.2)
st.plotting.save(figure, "holding_warm.png", overwrite=True)
