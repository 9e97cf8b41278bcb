"""Lanes of a `VectorSimulator` that share supplies: they are the servos of `simulate_bus`, however time is cut."""

import math
import pickle
from itertools import pairwise

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError

BATTERY = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.4)
REGULATOR = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.2, current_limit=1.4)
WIDTHS = np.array([[1.2e-3, 1.5e-3, 1.8e-3, 1.35e-3], [1.7e-3, 1.52e-3, 1.1e-3, 1.9e-3]])  # before and after
TURN, END = 0.1, 0.2  # s
SEEN = ("output_angle", "output_speed", "motor_speed", "armature_current", "armature_voltage", "bus_voltage",
        "supply_current", "load_torque", "feedback_voltage", "error_time", "drive")
PLAY = {"gear.backlash": 0.01, "gear.output_inertia": 5e-4}
# Of what the servos are, their load, supply, and model
CASES = {
    "plain": ({}, st.loads.Inertia(1e-3) + st.loads.Constant(0.1), BATTERY, st.PulseServo),
    "coupled": ({"electronics.supply_coupling": 0.02, "electronics.back_emf_injection": 3e-3, "potentiometer.noise":
                 1e-3, "electronics.off_state": "coast"}, st.loads.Inertia(2e-3), BATTERY, st.PulseServo),
    "regulated": ({"electronics.pulse_timeout": 0.012, "electronics.silence_state": "coast"},
                  st.loads.Spring(0.2), REGULATOR, st.PulseServo),
    "inductive": ({"motor.armature_inductance": 1e-3}, st.loads.Inertia(1e-3), BATTERY, st.PulseServoInductive),
    "with play": (PLAY | {"friction.load_friction_motor": 0.06, "friction.load_friction_external": 0.1},
                  st.loads.Inertia(1e-3), REGULATOR, st.PulseServo),
}


def sims_of(servo, name, lanes=4, **more):
    changes, load, supply, model = CASES[name]
    sims = st.VectorSimulator(model(servo.replace(changes)), lanes, load=load, seed=5, threads=1,
                              **{"bus": supply} | more)
    sims.reset(pulse_width=WIDTHS[0][:lanes])
    return sims


def advance(sims, ticks, widths=WIDTHS):
    for start, end in pairwise(ticks):
        sims.advance(float(end - start), pulse_width=widths[0 if start < TURN else 1][:len(sims)])


def together(servo, name, widths=WIDTHS, **more):
    changes, load, supply, model = CASES[name]
    model = model(servo.replace(changes))
    signals = [st.signals.step(1e6 * a, 1e6 * b, at=TURN, unit="us") for a, b in widths.T]
    return st.simulate_bus({str(k): (model, signal, load) for k, signal in enumerate(signals)},
                           **{"supply": supply, "duration": END, "seed": 5, "output_times": [END]} | more)


def agree(sims, fleet, tolerance=1e-9):
    for name in SEEN:
        there = np.array([result[name][-1] for result in fleet.values()])
        scale = 100.0 if name in ("output_speed", "motor_speed", "load_torque") else 1.0  # what angles amount to
        np.testing.assert_allclose(sims[name], there, rtol=1e-9, atol=scale * tolerance, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_lanes_on_a_bus_are_the_servos_of_simulate_bus_cut_at_random_ticks(servo, name):
    rng = np.random.default_rng(3)
    ticks = np.unique([0.0, TURN, END, *rng.uniform(0.0, END, 90).round(5)])
    sims = sims_of(servo, name)
    advance(sims, ticks)
    fleet = together(servo, name)
    agree(sims, fleet)
    assert np.ptp(sims["output_angle"]) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plain", "inductive"])
def test_how_time_is_cut_changes_rounding_alone(servo, name):
    runs = [sims_of(servo, name) for _ in range(3)]
    for sims, count in zip(runs, (1, 20, 333), strict=True):
        advance(sims, [*np.linspace(0.0, TURN, count + 1), *np.linspace(TURN, END, count + 1)[1:]])
    for sims in runs[1:]:
        np.testing.assert_allclose(sims["output_angle"], runs[0]["output_angle"], rtol=0.0, atol=1e-12)


@pytest.mark.slow
def test_what_is_saved_goes_on_as_if_nothing_had_been(servo):
    sims, other = sims_of(servo, "inductive"), sims_of(servo, "inductive")
    advance(sims, [0.0, 0.0537])
    memory = pickle.loads(pickle.dumps(sims.save()))
    advance(sims, [0.0537, 0.08])
    expected = sims["output_angle"]
    advance(other, [0.0, 0.02])
    for again in (sims, other):
        again.restore(memory)
        advance(again, [0.0537, 0.08])
        np.testing.assert_array_equal(again["output_angle"], expected)


@pytest.mark.slow
def test_each_lane_has_a_clock_of_its_own(servo):
    """A lane that is reset later has its frames later, as a servo has to whom pulses come later."""
    late, model = 0.007, st.PulseServo(servo.replace({"electronics.supply_coupling": 0.02}))
    sims = st.VectorSimulator(model, 2, bus=BATTERY, threads=1)
    start = model.start_angle(1.2e-3), model.start_angle(1.8e-3)
    sims.reset(pulse_width=[1.7e-3, 1.8e-3], output_angle=start)
    sims.advance(late)
    sims.reset(pulse_width=1.1e-3, output_angle=start[1:], lanes=[1])
    for _ in range(100):
        sims.advance(1e-3)
    trains = [st.signals.pulse_train(list(phase + model.frame_period * np.arange(8)), [width] * 8)
              for phase, width in ((0.0, 1700.0), (late, 1100.0))]
    fleet = st.simulate_bus({"a": (model, trains[0]), "b": (model, trains[1])}, supply=BATTERY, duration=0.107,
                            output_times=[0.107],
                            initial={"a": {"output_angle": start[0]}, "b": {"output_angle": start[1]}})
    agree(sims, fleet)
    np.testing.assert_allclose(sims.time, [0.107, 0.1], rtol=1e-12)
    assert abs(sims["output_angle"][1] - start[1]) > 0.1


@pytest.mark.slow
def test_buses_and_lanes_alone_do_not_feel_each_other(servo):
    """Lanes 1 and 4 on a battery, 2 and 3 on a regulator, 0 on its own: each as in a simulator of its own."""
    model, lanes = st.PulseServo(servo.replace({"supply.internal_resistance": 0.3})), 5
    widths = np.append(WIDTHS, [[1.3e-3], [1.6e-3]], axis=1)
    sims = st.VectorSimulator(model, lanes, bus=[(BATTERY, [1, 4]), (REGULATOR, np.arange(lanes) % 5 // 2 == 1)])
    sims.reset(pulse_width=widths[0])
    advance(sims, np.linspace(0.0, END, 11), widths)
    for some, supply in (([0], None), ([1, 4], BATTERY), ([2, 3], REGULATOR)):
        own = st.VectorSimulator(model, len(some), bus=supply, threads=1)
        own.reset(pulse_width=widths[0, some])
        advance(own, np.linspace(0.0, END, 11), widths[:, some])
        for name in ("output_angle", "bus_voltage", "supply_current"):
            np.testing.assert_allclose(sims[name][some], own[name], rtol=0.0, atol=1e-11, err_msg=name)


@pytest.mark.slow
def test_threads_change_nothing(servo):
    buses = [(BATTERY, [k, k + 1]) for k in range(0, 24, 2)]
    runs = [st.VectorSimulator(st.PulseServo(servo), 24, bus=buses, threads=threads) for threads in (1, 2)]
    for sims in runs:
        sims.reset(pulse_width=np.linspace(1.2e-3, 1.8e-3, 24))
        for _ in range(5):
            sims.advance(0.013, pulse_width=np.linspace(1.8e-3, 1.2e-3, 24))
    np.testing.assert_array_equal(runs[0]["output_angle"], runs[1]["output_angle"])


@pytest.mark.slow
def test_inertia_speed_and_parameters_may_be_set_on_a_bus(servo):
    model = st.PulseServo(servo)
    sims = st.VectorSimulator(model, 2, bus=BATTERY, threads=1)
    sims.reset(pulse_width=[1.2e-3, 1.8e-3])
    sims.set(load_inertia=[1e-3, 3e-3], output_speed=[2.0, 0.0], parameters={"electronics.stretcher_gain": 90.0})
    sims.advance(0.1, pulse_width=[1.7e-3, 1.1e-3])
    changed = st.PulseServo(servo.replace({"electronics.stretcher_gain": 90.0}))
    signals = [st.signals.step(a, b, unit="us") for a, b in ((1200.0, 1700.0), (1800.0, 1100.0))]
    fleet = st.simulate_bus(
        {"a": (changed, signals[0], st.loads.Inertia(1e-3)), "b": (changed, signals[1], st.loads.Inertia(3e-3))},
        supply=BATTERY, duration=0.1, output_times=[0.1],
        initial={"a": {"output_speed": 2.0, "output_angle": float(model.start_angle(1.2e-3))},
                 "b": {"output_angle": float(model.start_angle(1.8e-3))}})
    agree(sims, fleet)


@pytest.mark.slow
def test_another_supply_may_be_set_for_the_same_lanes(servo):
    """Half-way through the servos go on under the regulator, and begun anew they are those of a bus with it."""
    model = st.PulseServo(servo)
    sims, under = (st.VectorSimulator(model, 3, bus=supply, threads=1) for supply in (BATTERY, REGULATOR))
    for one in (sims, under):
        one.reset(pulse_width=WIDTHS[0][:3])
        one.advance(0.05, pulse_width=WIDTHS[1][:3])
    before = sims["output_angle"].copy()
    sims.set(bus=REGULATOR)
    np.testing.assert_array_equal(sims["output_angle"], before)
    sims.advance(0.02)
    assert np.abs(sims["bus_voltage"] - under["bus_voltage"]).max() > 1e-3  # they have got to other places
    sims.reset(pulse_width=WIDTHS[0][:3])
    under.reset(pulse_width=WIDTHS[0][:3])
    for one in (sims, under):
        one.advance(0.05, pulse_width=WIDTHS[1][:3])
    np.testing.assert_allclose(sims["output_angle"], under["output_angle"], atol=1e-12)
    with pytest.raises(InputError, match="on the buses that they are on"):
        sims.set(bus=[(BATTERY, [0, 1])])


@pytest.mark.slow
def test_the_energy_of_a_bus_closes(servo):
    """What the source gives is what windings, bridges, friction and loads have taken, and what is stored."""
    model = st.PulseServo(servo.replace({"motor.brush_drop_voltage": 0.1, "supply.bridge_drop_resistance": 0.2}))
    sims = st.VectorSimulator(model, 4, bus=BATTERY, load=st.loads.Inertia(2e-3), threads=1)
    sims.reset(pulse_width=WIDTHS[0])
    fleet = st.simulate_bus({str(k): (model, st.signals.step(1e6 * a, 1e6 * b, unit="us"), st.loads.Inertia(2e-3))
                             for k, (a, b) in enumerate(WIDTHS.T)}, supply=BATTERY, duration=0.1, output_step=1e-4)
    delivered = 0.0
    for _ in range(1000):
        sims.advance(5e-5, pulse_width=WIDTHS[1])
        middle = sims["bus_voltage"][0] * sims["supply_current"].sum()
        np.testing.assert_allclose(sims["bus_voltage"], 6.0 - 0.4 * sims["supply_current"].sum(), rtol=0.0, atol=1e-9)
        sims.advance(5e-5)
        delivered += 1e-4 * middle
    energy = fleet.energy
    assert abs(energy.residual) < 1e-9 * energy.winding
    assert delivered == pytest.approx(energy.supply, rel=2e-3)  # by midpoints, across edges of the drive


@pytest.mark.slow
def test_a_bus_that_cannot_go_on_harms_no_other(servo):
    stiff = {"load.spring.stiffness": [1e19, 0.1, 0.1, 0.1]}  # it oscillates too fast to be followed
    sims = st.VectorSimulator(st.PulseServo(servo), 4, bus=[(BATTERY, [0, 1]), (BATTERY, [2, 3])], threads=1,
                              load=st.loads.Spring(0.1), parameters=stiff)
    sims.advance(0.05, pulse_width=WIDTHS[1])
    assert sims.status.tolist() == [*[st.Status.TOO_FAST.code] * 2, 0, 0]
    assert [failure.lane for failure in sims.failures] == [0, 1]
    assert np.isnan(sims["output_angle"]).tolist() == [True, True, False, False]
    assert np.isnan(sims["bus_voltage"]).tolist() == [True, True, False, False]
    sims.set(parameters={"load.spring.stiffness": 0.1})
    sims.reset(pulse_width=1.5e-3, lanes=[0, 1])
    sims.advance(0.05)
    assert np.isfinite(sims["output_angle"]).all()


@pytest.mark.parametrize(("bus", "message"), [
    (3.0, "bus: .*a Supply that all lanes share"),
    ([], "a list of"),
    ([BATTERY], "a list of"),
    (st.Supply(internal_resistance=0.3), "supply of bus 0.*open_circuit_voltage"),
    (st.Supply(open_circuit_voltage=6.0, bridge_drop_voltage=0.2), "each servo"),
    ([(BATTERY, [])], "lanes of bus 0.*at least one lane"),
    ([(BATTERY, None)], "lanes of bus 0"),
    ([(BATTERY, [0, 1]), (REGULATOR, [4])], "lanes of bus 1.*0 to 3"),
    ([(BATTERY, [0, 1]), (REGULATOR, [2, 1])], "lane 1 of bus 1.*bus 0 too"),
])
def test_bad_buses(servo, bus, message):
    with pytest.raises(InputError, match=message):
        st.VectorSimulator(st.PulseServo(servo), 4, bus=bus)


@pytest.mark.slow
def test_what_a_bus_refuses(servo):
    with pytest.raises(InputError, match="PulseServoInductive or DigitalServo"):
        st.VectorSimulator(st.BoundedServo(st.load_servo("hitec-hs-755hb")), 2, bus=BATTERY)
    sims = st.VectorSimulator(st.PulseServo(servo), 3, bus=[(BATTERY, [1, 2])], threads=1)
    sims.set(bus_voltage=5.0, lanes=[0])
    entry = sims.c_entry()
    with pytest.raises(InputError, match="one that lanes share"):
        entry.advance(entry.tick(1e-3, set_bus_voltage=np.full(3, 5.0)))
    with pytest.raises(InputError, match="bus_voltage of lane 1"):
        sims.set(bus_voltage=5.0)
    with pytest.raises(InputError, match=r"supply\.internal_resistance of lane 2"):
        sims.set(parameters={"supply.internal_resistance": 0.2}, lanes=[2])
    assert math.isclose(float(sims["bus_voltage"][0]), 5.0)


@pytest.mark.long
def test_ticks_of_a_program_come_once_when_times_count_anew():
    """Calls as long as its ticks, over the instant from which times count anew: as without a shared supply."""
    model = st.DigitalServo(st.load_servo("feetech-sts3215-12v").replace({"gear.backlash": None}))
    supply = st.Supply(open_circuit_voltage=12.0)
    own = st.DigitalServo(model.servo.replace({"supply.open_circuit_voltage": 12.0, "supply.internal_resistance": 0.0}))
    both = (st.VectorSimulator(own, 1, load=st.loads.Inertia(1e-3)),
            st.VectorSimulator(model, 1, load=st.loads.Inertia(1e-3), bus=supply, threads=1))
    for sims in both:
        sims.reset(command_angle=0.5)
    for _ in range(400):
        for sims in both:
            sims.advance(1e-3, command_angle=1.2)
    assert both[0]["output_angle"][0] == pytest.approx(both[1]["output_angle"][0], abs=1e-12)


def test_a_limp_servo_on_a_bus_meets_its_teeth_once():
    """Its diodes block: teeth that meet parted by the torque of a current that the bus does not drive, without end."""
    servo = st.feetech_sts("lerobot", servo="feetech-sts3215-12v")
    battery = st.Supply(open_circuit_voltage=12.0, internal_resistance=0.1)
    sims = st.VectorSimulator(st.DigitalServo(servo), lanes=3, load=st.loads.Inertia(4e-3), bus=battery)
    for way in (1.0, -1.0):
        sims.reset(command_angle=0.0)
        sims.set(torque_enable=True)
        for k in range(100):  # it turns, goes limp, and its output falls onto the tooth before it
            if k == 40:
                sims.set(torque_enable=[False, True, True])
            sims.advance(2e-3, command_angle=[way, 0.3 + 0.02 * k, -0.3 - 0.02 * k],
                         external_torque=[0.0 if k < 40 else -0.1 * way, 0.1, -0.1])
            assert (sims.status == 0).all()
