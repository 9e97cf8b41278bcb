"""What a prompt shows of an object is one short line, and what a notebook shows a table."""

import html.parser

import pytest

import servotwin as st

SERVO = st.load_servo("hitec-hs-755hb")
MODEL, STEP = st.PulseServo(SERVO), st.signals.step(0.0, 20.0, at=0.1, unit="deg")
BATTERY = st.Supply(open_circuit_voltage=6.0)


@pytest.fixture(scope="module")
def shown():
    result, sheet = st.simulate(MODEL, STEP, duration=1.0), st.curves(MODEL, bandwidth=False)
    return {
        "servo": SERVO, "signal": STEP, "result": result, "metrics": result.step_metrics(),
        "state": st.Simulator(MODEL).initial(STEP), "simulator": st.Simulator(MODEL), "sheet": sheet,
        "part": sheet.voltages[0], "curve": sheet.voltages[0].cold, "vector": st.VectorSimulator(MODEL, lanes=3),
        "fleet": st.simulate_bus({"a": (MODEL, STEP)}, supply=BATTERY, duration=0.2)}


@pytest.mark.long(but="state-State(time=0, output_angle=0, output_speed=0)")
@pytest.mark.parametrize(("what", "text"), [
    ("servo", "Servo('hitec-hs-755hb', kind='analog', 34 values)"), ("signal", "Signal(angle, given in deg, 2 pieces)"),
    ("result", "Result(PulseServo('hitec-hs-755hb'), 1 s, COMPLETED, 1001 times)"),
    ("state", "State(time=0, output_angle=0, output_speed=0)"),
    ("simulator", "Simulator(PulseServo('hitec-hs-755hb'))"),
    ("sheet", "DataSheet(PulseServo('hitec-hs-755hb'), 6 V)"), ("part", "VoltageSheet(6 V, stall 1.65 N m)"),
    ("curve", "SpeedCurve(PulseServo('hitec-hs-755hb'), stall 1.65 N m, no load 4.65 rad/s)"),
    ("vector", "VectorSimulator(PulseServo('hitec-hs-755hb'), lanes=3)"),
    ("fleet", "Fleet(a; 0.2 s, COMPLETED, 201 times)")])
def test_a_repr_is_one_short_line(shown, what, text):
    assert repr(shown[what]) == text


@pytest.mark.parametrize(("what", "said"), [
    ("servo", "motor.torque_constant"), ("result", "reached the end"), ("metrics", "rise_time"),
    ("sheet", "stall torque [N m]")])
def test_a_notebook_gets_a_table(shown, what, said):
    text = shown[what]._repr_html_()
    assert said in text
    assert text.count("<table>") == text.count("</table>") == 1
    assert "nan" not in text
    html.parser.HTMLParser().feed(text)


def test_words_of_a_servo_are_no_html():
    servo = st.servo_from_values("a<b", {"motor": {"armature_resistance": 3.0}}, title="<script>")
    assert "<script>" not in servo._repr_html_()
