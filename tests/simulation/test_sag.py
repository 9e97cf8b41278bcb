"""How far the supply falls: least voltage and its time beside a loop of small steps, remarks, and sheets."""

import math

import numpy as np
import pytest

import kept_runs
import servotwin as st
from falling_supplies import BIG, SG90, SITUATIONS, STS, XL, model_of
from servotwin.datasheet.choice import candidate
from servotwin.errors import InputError
from servotwin.models.switched import SwitchedServo
from servotwin.parameters import catalog_names, operating_voltages, printed_points
from servotwin.simulation.remarks import BELOW_CHIP, BELOW_REGISTER, HELD_BACK, floor_of

STEP = 2e-5  # s
FALLING = {name: one for name, one in kept_runs.every().items() if isinstance(one.model, SwitchedServo) and (
    one.model.servo.supply.internal_resistance or one.model.servo.supply.current_limit)}


def small_steps(result, torque):
    """Return the least voltage of a run and when it came.

    The drives are those of the run, all else is a loop of its own: a motor with Coulomb friction behind a bridge whose
    duty is given, in steps of 20 us by Runge and Kutta; at each the voltage is what source and bridge agree upon.
    """
    servo = result.model.servo
    N, motor, supply = servo.gear.gear_reduction, servo.motor, servo.supply
    J = N**2 * motor.rotor_inertia
    K, K_b = N * motor.torque_constant, N * motor.back_emf_constant
    F = N * servo.friction.coulomb_torque_forward + (servo.friction.bearing_coulomb_torque or 0.0)
    b = N**2 * (motor.motor_viscous_friction or 0.0)
    V, R_b, limit = supply.open_circuit_voltage, supply.internal_resistance or 0.0, supply.current_limit or math.inf
    V_br, V_ce0 = motor.brush_drop_voltage or 0.0, supply.bridge_drop_voltage or 0.0
    R_a, r_c = motor.armature_resistance, supply.bridge_drop_resistance or 0.0

    def circuit(d, w):
        """Current of the motor and voltage of the bus at a duty, whose share of the time the bridge conducts."""
        turn, d = math.copysign(1.0, d), abs(d)
        lost, R = d * V_ce0 + V_br, R_a + d * r_c
        over, under = d * V - turn * K_b * w - lost, d * V - turn * K_b * w + lost
        i = over / (R + d * d * R_b) if over > 0.0 else min(under, 0.0) / (R + d * d * R_b)
        if d * i > limit:  # the source gives no more, at the voltage that this takes
            i = limit / d
            return turn * i, (R * i + turn * K_b * w + lost) / d
        if i < 0.0 and math.isfinite(limit):  # and takes nothing back
            return turn * under / R, V
        return turn * i, V - R_b * d * i

    def rate(d, w):
        if d == 0.0:  # braked: the current goes round in the bridge
            over = K_b * abs(w) - V_br
            i = -math.copysign(over / R_a, w) if over > 0.0 else 0.0
        else:
            i = circuit(d, w)[0]
        push = K * i - torque
        if w == 0.0:
            return (push - math.copysign(F, push)) / J if abs(push) > F else 0.0
        return (push - b * w - math.copysign(F, w)) / J

    w, least, when = 0.0, V, 0.0
    for segment in result.trajectory.segments:
        d = segment.drive if isinstance(result.model, st.PulseServo) else segment.duty
        d = d if abs(d) <= 1.0 else 0.0
        count = max(math.ceil((segment.end - segment.start) / STEP - 1e-6), 1)
        h = (segment.end - segment.start) / count
        for k in range(count + 1):
            volts = circuit(d, w)[1] if d else V
            if volts < least - 1e-7:
                least, when = volts, segment.start + k * h
            if k < count:
                a = rate(d, w)
                b2 = rate(d, w + 0.5 * h * a)
                c = rate(d, w + 0.5 * h * b2)
                e = rate(d, w + h * c)
                after = w + h * (a + 2.0 * b2 + 2.0 * c + e) / 6.0
                w = 0.0 if w * after < 0.0 and abs(K * (circuit(d, 0.0)[0] if d else 0.0) - torque) <= F else after
    return least, when


@pytest.mark.parametrize(("name", "supply", "torque"), SITUATIONS)
def test_the_least_voltage_is_that_of_small_steps(name, supply, torque):
    model = model_of(name, supply)
    ends = (10.0, 80.0) if name == BIG else (-40.0, 40.0)
    command = st.signals.step(*ends, at=0.04, unit="deg")
    load = st.loads.Constant(torque)
    result = st.simulate(model, command, load=load, duration=0.3, output_step=0.1)
    least, when = small_steps(result, torque)
    bus = st.simulate_bus({"one": (model, command, load)}, supply=st.Supply.of(supply), duration=0.3, output_step=0.1)
    lanes = st.simulate_many(model, command, load=load, duration=0.3, output_step=0.1, watch_supply=True)
    if (name, supply) == (STS, "12V:5A"):  # it gives all that is asked
        assert (least, result.sag, bus.sag) == (12.0, None, None)
        assert lanes.lowest_voltage[0, 0] == pytest.approx(12.0)
        return
    for voltage, time in (result.sag[:2], bus.sag[:2], lanes.lowest_voltage[:, 0]):
        assert voltage == pytest.approx(least, abs=1e-6)
        assert time == pytest.approx(when, abs=1e-3)
    assert result.least("bus_voltage") == (result.sag.voltage, result.sag.time)


@pytest.mark.parametrize(("name", "supply", "torque"), SITUATIONS)
def test_the_least_voltage_between_two_ticks_is_that_of_the_run(name, supply, torque):
    """One servo alone, and two on one supply that turn at once."""
    model, load = model_of(name, supply), st.loads.Constant(torque)
    low, high = (0.3, 1.1) if name == BIG else (-0.4, 0.4)
    command = st.signals.step(low, high, at=0.05, unit="rad")
    other = st.signals.step(high, low, at=0.05, unit="rad")
    source = st.Supply.of(supply)
    alone = st.simulate(model, command, load=load, duration=0.2, output_step=0.1)
    both = st.simulate_bus({"one": (model, command, load), "other": (model, other, load)}, supply=source, duration=0.2,
                           output_step=0.1)
    for sag, bus, goals in ((alone.sag, None, (low, high)), (both.sag, source, ([low, high], [high, low]))):
        sims = st.VectorSimulator(model, 2, load=load, bus=bus, watch_supply=True)
        sims.reset(command_angle=goals[0])
        for k in range(100):
            sims.advance(2e-3, command_angle=goals[0] if k < 25 else goals[1])
        expected = (source.open_circuit_voltage, 0.0) if sag is None else sag[:2]
        np.testing.assert_allclose(sims.lowest_voltage.T, [expected, expected], atol=1e-7)


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if k % 9 == 0 else pytest.mark.long)
                                  for k, name in enumerate(FALLING)])
def test_lanes_find_the_least_voltage_that_their_motions_have(name):
    """Of servos with any terms, on a supply that falls: between all samples of the continuous solution."""
    one = FALLING[name]
    run = {"duration": one.duration, "load": one.load, "output_times": [one.duration]}
    sag = st.simulate(one.model, one.command, initial=one.initial, seed=one.seed, **run).sag
    batch = st.simulate_many(one.model, one.command, initial=one.initial, seeds=[one.seed], watch_supply=True, **run)
    voltage, time = batch.lowest_voltage[:, 0]
    if sag is None:
        assert voltage == pytest.approx(one.model.servo.supply.open_circuit_voltage, rel=2e-6)
    else:
        assert voltage == pytest.approx(sag.voltage, abs=1e-7)
        assert time == pytest.approx(sag.time, abs=1e-4)


def test_what_was_least_is_remembered():
    model = model_of(SG90, "5V:3ohm")
    for bus in (None, st.Supply.of("5V:3ohm")):
        sims = st.VectorSimulator(model, 2, bus=bus, watch_supply=True)
        assert np.isnan(sims.lowest_voltage).all()
        sims.reset(command_angle=0.3)
        sims.advance(0.02, command_angle=-0.3)
        sims.advance(0.02)
        least, memory = sims.lowest_voltage, sims.save()
        assert (least[0] < 4.0).all()
        sims.set(parameters={"load.inertia": 1e-5})
        sims.watch([1])
        assert sims.lowest_voltage[0, 0] == (math.nan if bus else least[0, 0]) or bus
        assert math.isnan(sims.lowest_voltage[0, 1])
        sims.restore(memory)
        np.testing.assert_array_equal(sims.lowest_voltage, least)
        sims.reset(lanes=[0])
        assert math.isnan(sims.lowest_voltage[0, 0])
    with pytest.raises(InputError, match="watch_supply=True"):
        st.VectorSimulator(model, 1).watch()


def said(name, supply, load=0.0):
    servo = st.load_servo(name)
    from servotwin.datasheet.holding import on_supply

    model = (st.DigitalServo if servo.kind == "bus" else st.PulseServo)(on_supply(servo, st.Supply.of(supply)))
    result = st.simulate(model, st.signals.step(-40.0, 40.0, at=0.04, unit="deg"), load=st.loads.Constant(load),
                         duration=0.4, output_step=0.1)
    return {remark.kind: remark for remark in result.remarks}


@pytest.mark.parametrize(("name", "supply", "load", "kinds"), [
    (SG90, "5V:0.2A", 0.0, {HELD_BACK, BELOW_CHIP}), (SG90, "5V:3ohm", 0.0, {HELD_BACK}),
    (SG90, "5V:0.1ohm", 0.0, set()), (STS, "12V:0.3ohm", 0.0, set()), (SG90, "5V", 0.0, set()),
    (STS, "6V:9ohm", 0.1, {HELD_BACK, BELOW_REGISTER})])
def test_what_is_said_of_a_supply(name, supply, load, kinds):
    found = said(name, supply, load)
    assert {kind for kind in found if kind in (HELD_BACK, BELOW_CHIP, BELOW_REGISTER)} == kinds
    for kind in kinds:
        assert f"{found[kind].numbers['voltage']:.2f} V at least" in found[kind].words


def test_a_protection_that_watches_the_supply_says_it_itself():
    """An XL330's Shutdown has the bit of its supply, an STS3215's mask has not."""
    watching = st.load_servo(XL).replace({"supply.open_circuit_voltage": 5.0, "supply.internal_resistance": 4.0})
    result = st.simulate(st.DigitalServo(watching), st.signals.step(-40.0, 40.0, at=0.04, unit="deg"),
                         load=st.loads.Constant(0.2), duration=0.4)
    assert result.sag.voltage < floor_of(watching).voltage
    assert BELOW_REGISTER not in dict(result.remarks)
    assert "tripped by undervoltage" in dict(result.remarks)


@pytest.mark.parametrize("text", ["usb", "3.3V", "5V", "7.4V"])
def test_no_servo_is_taken_outside_what_its_maker_states_or_far_below_what_is_printed(text):
    supply = st.Supply.of(text)
    volts, taken = supply.open_circuit_voltage, set()
    for name in catalog_names():
        servo = st.load_servo(name)
        if "voltage" in [reason.kind for reason in candidate(servo, supply).reasons]:
            continue
        taken.add(name)
        if "voltage_min" in servo.sheet:
            assert servo.sheet["voltage_min"]["value"] <= volts <= servo.sheet["voltage_max"]["value"], name
        else:
            printed = [point.supply_voltage for point in printed_points(servo) if point.supply_voltage]
            assert volts >= 0.9 * min(printed, default=0.0), name
    assert {"towerpro-mg996r", "towerpro-sg90", XL} & taken == {
        "3.3V": set(), "7.4V": set()}.get(text, {"towerpro-mg996r", "towerpro-sg90", XL})


@pytest.mark.parametrize(("name", "taken", "refused"), [
    ("towerpro-mg996r", (4.8, 5.0, 7.2), (4.7, 7.4)), ("dynamixel-xl-320", (6.0, 7.4, 8.4), (5.0, 8.5)),
    ("feetech-sts3215-7v4", (5.0, 7.4), (3.7, 8.4)), ("dynamixel-xm430-w350", (11.1, 14.8), (9.9, 15.0)),
    (STS, (10.9, 15.0), (10.7, 15.1)), ("gobilda-2000-135", (4.4, 9.2), (4.3, 9.3))])  # of these no range is known
def test_a_stated_range_is_kept_and_printed_figures_have_a_margin(name, taken, refused):
    servo = st.load_servo(name)
    for volts in (*taken, *refused):
        kinds = [reason.kind for reason in candidate(servo, volts).reasons]
        assert ("voltage" in kinds) is (volts in refused), volts


def test_stated_ranges_hold_the_printed_voltages_and_lie_above_where_an_alarm_sets_in():
    stated = {name: found for name in catalog_names() if (found := operating_voltages(st.load_servo(name)))}
    assert len(stated) >= 27
    for name, (low, high) in stated.items():
        servo = st.load_servo(name)
        assert all(low <= point.supply_voltage <= high for point in printed_points(servo)), name
        assert servo.kind != "bus" or floor_of(servo).voltage <= low, name


def test_a_fleet_tells_its_supply_and_each_servo_it():
    """Twelve SG90 at 3.5 A: the limit holds them all."""
    model = model_of(SG90, "5V:3.5A")
    command = st.signals.step(0.0, 60.0, at=0.05, unit="deg")
    fleet = st.simulate_bus({f"s{k}": (model, command) for k in range(12)}, supply=st.Supply.of("5V:3.5A"),
                            duration=0.2)
    assert fleet.sag.voltage < 3.0
    assert fleet.sag.voltage <= fleet.bus_voltage.min()
    assert fleet.sag.limited == pytest.approx(
        1e-3 * np.count_nonzero(fleet.supply_current > 3.5 - 1e-9), abs=2e-3)
    assert {servo for servo, kind, _ in fleet.remarks if kind == HELD_BACK} == set(fleet)


def test_a_sweep_has_the_least_voltage_of_its_samples_and_a_lane_the_exact_one():
    model = model_of(SG90, "5V:3ohm")
    command = st.signals.step(-40.0, 40.0, at=0.04, unit="deg")
    study = st.sweep(model, command, duration=0.3, lanes=3, vary={"supply.internal_resistance": "uniform:1..3"},
                     metrics=["lowest_voltage"], output_step=1e-3)
    given = study.table["supply.internal_resistance"]
    batch = st.simulate_many(model, command, parameters={"supply.internal_resistance": given}, duration=0.3)
    for k, ohms in enumerate(given.tolist()):
        alone = st.simulate(model_of(SG90, f"5V:{ohms!r}ohm"), command, duration=0.3, output_step=1e-3)
        assert study.table["lowest_voltage"][k] == pytest.approx(alone["bus_voltage"].min(), abs=0.05)
        assert study.table["lowest_voltage"][k] >= alone.sag.voltage - 1e-9
        assert batch[k].sag == alone.sag
