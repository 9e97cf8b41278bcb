"""What a bench shows is what a Simulator says that is given the same commands, pushes and changes at their times."""

import math
import random

import pytest

import servotwin as st
from servotwin.web.live import LiveBench, read_scene, replay

ACTIONS = [
    (0.0, "command", 60.0), (0.313, "command", 90.0), (0.5004, "push", 0.2), (0.81, "set", {"load.inertia": 2e-4}),
    (0.83, "set", {"friction.coulomb_torque_forward": 5e-4}), (0.9, "push", 0.0), (1.1, "command", 95.0),
    (1.2, "set", {"load.pendulum.mass": 0.0, "load.torque": -0.1}), (1.35, "command", 40.0)]
END = 2.0
CASES = [("hitec-hs-755hb", "PulseServo", {}), ("hitec-hs-755hb", "PulseServo", {"potentiometer.noise": 2e-3}),
         ("hitec-hs-755hb", "PulseServoInductive", {}), ("hitec-hs-755hb", "BoundedServo", {}),
         ("hitec-hs-755hb", "AveragedServo", {}), ("towerpro-mg996r", "DigitalServo", {}),
         ("feetech-sts3215-12v", "DigitalServo", {}), ("hitec-hs-755hb", "PulseServo", {"gear.backlash": 0.01})]


def scene_text(servo: str, model: str, parameters: dict, rate: float = 50.0) -> str:
    shift = 0.0 if servo.startswith("hitec") else -60.0
    lines = ["format = 1", "seed = 5", f"frame_rate = {rate}", f"end = {END}", "actions = ["]
    for time, kind, value in ACTIONS:
        told = f'{{shape = "hold", unit = "deg", value = {value + shift}}}' if kind == "command" else (
            "{" + ", ".join(f'"{name}" = {one}' for name, one in value.items()) + "}" if kind == "set" else value)
        lines.append(f'[{time}, "{kind}", {told}],')
    values = ", ".join(f'"{name}" = {value}' for name, value in parameters.items())
    return "\n".join([*lines, "]", "[[servo]]", f'id = "{servo}"', f'model = "{model}"', f"parameters = {{{values}}}",
                      "[load]", "mass = 0.05", "arm = 0.1"])


def simulated(servo: str, model: str, parameters: dict, times: list[float]) -> list[float]:
    """Return the angles [rad] at some times by a Simulator, told everything at its time."""
    sim = st.Simulator(getattr(st, model)(st.load_servo(servo).replace(parameters)),
                       load=st.loads.Pendulum(mass=0.05, length=0.1), seed=5)
    shift = 0.0 if servo.startswith("hitec") else -60.0
    command = st.signals.constant(60.0 + shift, unit="deg")
    state, push, found = sim.initial(command), 0.0, []
    plan = sorted([*ACTIONS, *((time, "look", None) for time in times)], key=lambda one: one[0])
    for time, kind, value in plan:
        state = sim.advance(state, time, command, external_torque=push)
        if kind == "command":
            command = st.signals.constant(value + shift, unit="deg")
        elif kind == "push":
            push = value
        elif kind == "set":
            state = sim.changed(state, parameters=value)
        else:
            found.append(state["output_angle"])
    return found


@pytest.mark.long(but="hitec-hs-755hb-PulseServo-parameters0")
@pytest.mark.parametrize(("servo", "model", "parameters"), CASES)
def test_the_trace_is_that_of_a_simulator_whatever_the_pace(servo, model, parameters):
    bench, pace = LiveBench(read_scene(scene_text(servo, model, parameters))), random.Random(3)
    place, shown = bench.columns[0].index("output_angle"), []
    while bench.time < END:  # slow motion, single frames, pushes of a browser, and leaps
        until = bench.time + pace.choice([1e-5, 7e-4, 1 / 60, 0.02, 0.13])
        push = bench.advance(min(END, until), pace.choice([50.0, 1e3]))
        shown += [(row[0], row[place]) for row in push.servos[0].points]
    shown = shown[:: max(1, len(shown) // 60)]
    expected = simulated(servo, model, parameters, [time for time, _ in shown])
    assert max(abs(angle - other) for (_, angle), other in zip(shown, expected, strict=True)) < 1e-9


@pytest.mark.long(but="hitec-hs-755hb-PulseServo-parameters1")
@pytest.mark.parametrize(("servo", "model", "parameters"), CASES)
def test_a_text_repeats_the_bench_to_the_last_bit(servo, model, parameters):
    text = scene_text(servo, model, parameters)
    bench = LiveBench(read_scene(text))
    bench.advance(END, 100.0)
    again = replay(bench.scene().text(), output_step=0.01)
    assert dict(zip(bench.columns[0], bench.rows[0], strict=True))["output_angle"] == pytest.approx(
        again[0]["output_angle"][-1], abs=1e-12)


def test_lost_frames_are_those_of_one_train_of_pulses():
    bench = LiveBench(read_scene('format = 1\nseed = 2\n[[servo]]\nid = "hitec-hs-755hb"\n'))
    bench.do("command", {"shape": "hold", "unit": "us", "value": 1600.0})
    pulses = []
    for value, end in (({"lost": 0.4}, 0.5), ({"rate": 100.0}, 0.9), ({"rate": 25.0, "lost": 1.0}, 1.4),
                       ({"lost": 0.0}, 2.0)):
        bench.do("frames", value)
        bench.do("command", {"shape": "hold", "unit": "us", "value": 1600.0 + 200.0 * math.sin(7.0 * end)})
        while bench.time < end:
            pulses += bench.advance(min(end, bench.time + 0.0333), 100.0).servos[0].pulses
    sent = [(edge, width) for edge, width in pulses if width > 0.0]
    model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    train = st.signals.pulse_train([edge for edge, _ in sent], [width for _, width in sent], unit="s")
    start = {"output_angle": math.pi / 2.0}  # the middle of its travel
    load = st.loads.Pendulum(mass=0.0, length=0.1)
    result = st.simulate(model, train, duration=2.0, load=load, initial=start, seed=2)
    assert len(sent) < 60
    assert bench.rows[0][bench.columns[0].index("output_angle")] == pytest.approx(result["output_angle"][-1], abs=1e-9)
