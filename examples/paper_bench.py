"""The bench of Urrea & Kern (2011): the five voltages of Table II, simulated beside measured."""

import servotwin as st

table = st.load_dataset("urrea-kern-table-2").columns
bench = st.bench.Bench(st.BoundedServo(st.bench.bench_servo(st.load_servo("hitec-hs-755hb"))))

print(" V_i [V]   t_a [us]        q [deg]          V_o [V]")
for row, (t_a, q, v_o) in zip(bench.measure(table["V_i_V"].tolist()),
                              zip(table["t_a_us"], table["q_deg"], table["V_o_V"], strict=True), strict=True):
    reading = row.reading
    print(f"{reading.command_voltage:8.3f} {1e6 * reading.pulse_width:6.0f} ({t_a:4.0f}) "
          f"{57.29578 * reading.output_angle:8.2f} ({q:3.0f}) {reading.feedback_voltage:8.3f} ({v_o:.3f})")
