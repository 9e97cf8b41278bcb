"""The bridge while no pulses come: before the first one, and after the last for as long as the chip waits."""

import math
import pickle
from itertools import pairwise, product

import numpy as np
import pytest

import servotwin as st
from servotwin.models import PulseServo, PulseServoInductive

HS755 = st.load_servo("hitec-hs-755hb").replace({
    "electronics.pulse_timeout": 0.03, "motor.motor_viscous_friction": 1e-6, "supply.internal_resistance": 0.2})
# Three pulses, silence from 0.07 s on, three more, silence again
TRAIN = st.signals.pulse_train([0.01, 0.02, 0.04, 0.12, 0.14, 0.16], [1700.0, 1900.0, 2000.0, 1500.0, 900.0, 1000.0])
SILENCE = [(0.0, 0.01), (0.07, 0.12), (0.19, 0.25)]
WORDS = ("brake", "coast")
PAIRS = [pair for pair in product(WORDS, WORDS) if pair[0] != pair[1]]
FEATURES = {
    "plain": (PulseServo, {}),
    "inductance": (PulseServoInductive, {"motor.armature_inductance": 8e-4}),
    "heat": (PulseServo, {"thermal.winding_capacity": 0.3, "thermal.housing_capacity": 3.0,
                          "thermal.winding_to_housing": 10.0, "thermal.housing_to_ambient": 20.0}),
    "play": (PulseServo, {"gear.backlash": 0.01, "gear.output_inertia": 1e-3}),
    "coupled": (PulseServo, {"electronics.supply_coupling": 0.02, "electronics.back_emf_injection": 0.004}),
    "regulator": (PulseServo, {"supply.current_limit": 0.7}),
}
SIGNALS = ("output_angle", "output_speed", "armature_voltage", "armature_current", "bus_voltage", "supply_current",
           "drive", "load_torque")


def servo(off, silence, feature="plain", **more):
    kind, numbers = FEATURES[feature]
    return kind(HS755.replace({**numbers, "electronics.off_state": off, "electronics.silence_state": silence, **more}))


def loop(model, open_):
    """Return λ and what dry friction and load take, per inertia, of a shaft behind a bridge that is off."""
    numbers = model.pack(st.loads.Constant(0.1).as_load())
    damping = numbers.shaft.b + (0.0 if open_ else numbers.motor.K * numbers.motor.K_b / numbers.motor.R)
    return damping / numbers.shaft.J, numbers.friction.F_forward / numbers.shaft.J, 0.1 / numbers.shaft.J


@pytest.mark.parametrize(("off", "silence"), PAIRS)
def test_before_the_first_pulse(off, silence):
    model = servo(off, silence)
    result = st.simulate(model, TRAIN, duration=0.02, load=st.loads.Constant(0.1),
                         initial={"output_angle": 1.0, "output_speed": 5.0})
    rate, friction, load = loop(model, silence == "coast")
    stands = math.log1p(rate * 5.0 / (friction + load)) / rate  # ẇ = −(friction + load) − λ w
    t = np.linspace(0.0, min(stands, 0.0099), 50)
    final = -(friction + load) / rate
    np.testing.assert_allclose(result.at("output_speed", t), final + (5.0 - final) * np.exp(-rate * t), rtol=1e-11)
    voltage = result.at("armature_voltage", t[:-1])
    moving = result.at("motor_speed", t[:-1]) * model.servo.motor.back_emf_constant
    np.testing.assert_allclose(voltage, moving if silence == "coast" else 0.0 * moving, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize(("off", "silence"), PAIRS)
def test_each_stretch_is_that_of_a_servo_with_that_off_state(off, silence, feature):
    """A run in pieces: with the bridge of one word where pulses come, of the other where they stay away."""
    model, load = servo(off, silence, feature), st.loads.Pendulum(mass=0.3, length=0.05)
    sim = st.Simulator(model, load=load, accuracy=1e-11)
    whole = state = sim.initial(TRAIN, {"output_angle": 0.5, "output_speed": 4.0})
    cuts = [0.0, *(t for stretch in SILENCE for t in stretch if t > 0.0)]
    for start, end in pairwise(cuts):
        word = silence if any(a <= start < b for a, b in SILENCE) else off
        state = sim.changed(state, parameters={"electronics.off_state": word, "electronics.silence_state": word})
        state = sim.advance(state, end, TRAIN)
        whole = sim.advance(whole, end, TRAIN)
        np.testing.assert_allclose(state.values, whole.values, rtol=1e-8 if feature == "heat" else 1e-10, atol=1e-10)


@pytest.mark.long(but="brake-coast-plain")
@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize(("off", "silence"), PAIRS)
def test_plain_lanes_ticks_and_bus_are_one(off, silence, feature):
    model, load, initial = servo(off, silence, feature), st.loads.Constant(0.15), {"output_angle": 0.5}
    times = np.linspace(0.0, 0.25, 126)[1:] - 1e-4
    plain = st.simulate(model, TRAIN, duration=0.25, load=load, initial=initial)
    want = np.array([plain.at(name, times) for name in SIGNALS])
    lanes = st.simulate_many(model, [TRAIN] * 3, duration=0.25, load=load, initial=initial, outputs=SIGNALS,
                             output_step=2e-3)
    at = np.searchsorted(lanes["time"], np.linspace(0.0, 0.25, 126)[1:-1] - 1e-9)
    same = np.array([plain.at(name, lanes["time"][at]) for name in SIGNALS])
    np.testing.assert_allclose(np.array([lanes[name][1, at] for name in SIGNALS]), same, rtol=1e-9, atol=1e-9)
    own = model.servo.supply
    supply = st.Supply(open_circuit_voltage=own.open_circuit_voltage, internal_resistance=own.internal_resistance,
                       current_limit=own.current_limit)
    together = st.simulate_bus({"a": (model, TRAIN, load), "b": (model, st.signals.pulse_train([0.3], [1500.0]))},
                               supply=supply, duration=0.25,
                               initial={"a": initial, "b": {"output_angle": 0.5}})
    alone = np.array([together["a"].at(name, times) for name in SIGNALS])
    np.testing.assert_allclose(alone, want, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize(("off", "silence"), PAIRS)
def test_the_first_pulse_is_measured_by_a_bridge_that_is_still_silent(off, silence):
    model = servo(off, silence, **{"electronics.back_emf_injection": 0.02, "gear.output_inertia": 0.5})
    result = st.simulate(model, TRAIN, duration=0.02, initial={"output_angle": 0.6, "output_speed": 4.0})
    before = 0.01 - 1e-12
    v_m = model.servo.motor.back_emf_constant * result.at("motor_speed", before) if silence == "coast" else 0.0
    v_o = result.at("feedback_voltage", before)
    chip = model.servo.electronics
    T_os = (chip.one_shot_offset or 0.0) + chip.one_shot_slope * (v_o + 0.02 * v_m)
    assert abs(result.at("output_speed", before)) > 1.0
    assert result.at("error_time", 0.0199) == pytest.approx(1700e-6 - T_os, rel=1e-8)


@pytest.mark.parametrize(("off", "silence"), PAIRS)
def test_two_on_a_stiff_bus_go_silent_each_for_itself(off, silence):
    model = servo(off, silence, **{"supply.internal_resistance": 0.0, "stops.lower_angle": -20.0})
    supply = st.Supply(open_circuit_voltage=model.servo.supply.open_circuit_voltage)
    other = st.signals.step(0.2, 1.6, at=0.0, unit="rad")
    starts = {"a": {"output_angle": 0.5, "output_speed": -3.0}, "b": {"output_angle": 0.2}}
    load = st.loads.Constant(0.9)  # turns an open motor, which is on the bus then, while the other drives
    fleet = st.simulate_bus({"a": (model, TRAIN, load), "b": (model, other)}, supply=supply, duration=0.25,
                            initial=starts)
    times = np.append(np.linspace(0.0, 0.25, 251)[1:] - 1e-4, np.ravel(SILENCE)[1:] - 1e-9)
    for name, command, hung in (("a", TRAIN, load), ("b", other, None)):
        alone = st.simulate(model, command, duration=0.25, load=hung, initial=starts[name])
        for signal in ("output_angle", "output_speed", "armature_voltage"):
            np.testing.assert_allclose(fleet[name].at(signal, times), alone.at(signal, times), rtol=1e-9, atol=1e-9)
        assert [(e.kind, e.time) for e in fleet[name].events if "silence" in e.kind] == [
            (e.kind, pytest.approx(e.time)) for e in alone.events if "silence" in e.kind]


def test_a_run_may_be_cut_anywhere():
    model = servo("brake", "coast")
    sim = st.Simulator(model, load=st.loads.Constant(0.2))
    whole = sim.advance(sim.initial(TRAIN, {"output_angle": 0.4}), 0.25, TRAIN)
    run = st.simulate(model, TRAIN, duration=0.25, load=st.loads.Constant(0.2), initial={"output_angle": 0.4})
    ends = np.array(SILENCE).ravel()
    cuts = np.sort(np.append(np.random.default_rng(3).uniform(0.0, 0.25, 60), [0.01, 0.07, 0.12, 0.19, 0.25]))
    state = sim.initial(TRAIN, {"output_angle": 0.4})
    for t in cuts.tolist():
        state = pickle.loads(pickle.dumps(sim.advance(state, t, TRAIN)))
        if abs(t - ends).min() > 1e-9:  # there the state is that of just before, the run's of just after
            voltage = sim.observe(state, "armature_voltage", TRAIN)
            assert voltage == pytest.approx(run.at("armature_voltage", t), abs=1e-9)
    np.testing.assert_allclose(state.values, whole.values, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("feature", ["plain", "inductance", "play"])
def test_energy_is_kept_and_silence_told(feature):
    result = st.simulate(servo("coast", "brake", feature), TRAIN, duration=0.25, load=st.loads.Constant(0.2),
                         initial={"output_angle": 0.5, "output_speed": 8.0})
    energy = result.energy
    assert abs(energy.residual) < 1e-9 * (abs(energy.supply) + energy.winding + energy.friction)
    said = [(event.kind, round(event.time, 9)) for event in result.events if "silence" in event.kind]
    assert said == [("silence ends", 0.01), ("silence begins", 0.07), ("silence ends", 0.12), ("silence begins", 0.19)]


def test_without_a_word_of_its_own_it_is_off_as_between_drives():
    for off in WORDS:
        plain = HS755.replace({"electronics.off_state": off})
        runs = [st.simulate(PulseServo(one), TRAIN, duration=0.25, load=st.loads.Constant(0.2),
                            initial={"output_angle": 0.5})
                for one in (plain, plain.replace({"electronics.silence_state": off}))]
        np.testing.assert_array_equal(runs[0]["output_angle"], runs[1]["output_angle"])
        assert not [event for event in runs[0].events if "silence" in event.kind]


def test_lanes_hold_a_load_that_others_drop():
    """Behind a back-drivable gear a braked servo sinks slowly, an open one falls."""
    base = PulseServo(HS755.replace({"electronics.off_state": "brake", "stops.lower_angle": -50.0}))
    sims = st.VectorSimulator(base, 2, load=st.loads.Constant(0.6),
                              parameters={"electronics.silence_state": ["brake", "coast"]})
    sims.reset(output_angle=1.0)
    sims.advance(0.5, pulse_width=[1.7e-3, 1.7e-3])
    held = sims["output_angle"].copy()
    sims.advance(0.4, pulse_width=[3.5e-3, 3.5e-3])  # no pulse that it takes
    braked, open_ = held - sims["output_angle"]
    assert braked > 0.2
    assert open_ > 4.0 * braked
