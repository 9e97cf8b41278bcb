"""Digital servos on one supply: what they do to each other, alone and beside pulse servos."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

import servotwin as st
from servotwin.simulation import bus_run

V_OC, R_B = 12.0, 0.7
BATTERY = st.Supply(open_circuit_voltage=V_OC, internal_resistance=R_B)
LOAD = st.loads.Constant(0.3) + st.loads.Inertia(2e-3)
STEP = st.signals.step(0.1, 1.0, at=0.02, unit="rad")
ROUGH = {"friction.coulomb_torque_forward": 2e-4, "friction.coulomb_torque_backward": 3e-4,
         "firmware.angle_quantum": 2.0 * math.pi / 4096.0}
BUSY = {**ROUGH, "firmware.speed_limit": 5.0, "firmware.acceleration_limit": 80.0, "firmware.current_limit": 1.5,
        "firmware.trip_current": 9.0, "firmware.trip_time": 0.1, "firmware.overload_duty": 0.6,
        "firmware.overload_time": 0.1, "firmware.overload_output": 0.2}
DROPS = {"supply.bridge_drop_voltage": 0.3, "supply.bridge_drop_resistance": 0.1, "motor.brush_drop_voltage": 0.1}
SORTS = {
    "bare": {}, "rough": ROUGH, "everything": BUSY, "drops": BUSY | DROPS,
    "a diode": {**BUSY, "firmware.off_state": "diode"},
    "slow PWM": {**BUSY, "firmware.off_state": "coast"},
    "late duties": {**BUSY, **DROPS, "firmware.compute_delay": 1.7e-3},
}


def digital(more=None, R_b=R_B):
    servo = st.servo_from_values("on a bus", {
        "motor": {"armature_resistance": 3.0, "torque_constant": 3e-3, "back_emf_constant": 3e-3,
                  "rotor_inertia": 1e-8, "motor_viscous_friction": 1e-8},
        "gear": {"gear_reduction": 345.0},
        "friction": {"coulomb_torque_forward": 0.0, "coulomb_torque_backward": 0.0},
        "supply": {"open_circuit_voltage": V_OC, "internal_resistance": R_b},
        "firmware": {"control_period": 1e-3, "command_kind": "goal", "proportional_gain": 8.0,
                     "derivative_gain": 0.05}}, kind="bus")
    return st.DigitalServo(servo.replace(more or {}))


def off(results, one, names=("output_angle", "output_speed", "duty", "bus_voltage", "reference_angle", "trip")):
    """Return how far results are from another, in all signals."""
    return max(np.abs(result[name] - one[name]).max() for result in results for name in names)


@pytest.mark.parametrize("sort", SORTS)
def test_alone_on_a_bus_it_is_the_servo_alone(sort):
    model = digital(SORTS[sort])
    fleet = st.simulate_bus({"a": (model, STEP, LOAD)}, supply=BATTERY, duration=0.4)
    one = st.simulate(model, STEP, load=LOAD, duration=0.4)
    assert off([fleet["a"]], one, one.names) < 1e-10
    assert [(event.kind, event.time) for event in fleet["a"].events] == [
        (event.kind, pytest.approx(event.time, abs=1e-12)) for event in one.events]


@pytest.mark.long(but="drops")
@pytest.mark.parametrize("sort", SORTS)
def test_twins_on_one_bus_are_one_servo_on_twice_the_resistance(sort):
    model, half = digital(SORTS[sort]), st.Supply(open_circuit_voltage=V_OC, internal_resistance=0.5 * R_B)
    twins = st.simulate_bus({"a": (model, STEP, LOAD), "b": (model, STEP, LOAD)}, supply=half, duration=0.4)
    assert off(twins.results.values(), st.simulate(model, STEP, load=LOAD, duration=0.4)) < 1e-10


@pytest.mark.parametrize("R_b", [0.0, 2.0])
def test_unlike_servos_move_by_the_exponential_of_their_common_law(R_b):
    """Two bare servos with ticks of 1 ms and 1.5 ms: between ticks all is linear, and V = V_oc − R_b Σ d i."""
    periods, gains, inertias, goals = (1e-3, 1.5e-3), (8.0, 3.0), (2e-3, 6e-3), (1.0, -0.7)
    models = [digital({"firmware.control_period": T, "firmware.proportional_gain": k_p, "firmware.derivative_gain": 0.0,
                       "firmware.duty_limit": 0.9}) for T, k_p in zip(periods, gains, strict=True)]
    fleet = st.simulate_bus({str(k): (models[k], st.signals.constant(goals[k], unit="rad"),
                                      st.loads.Inertia(inertias[k])) for k in range(2)},
                            supply=st.Supply(open_circuit_voltage=V_OC, internal_resistance=R_b), duration=0.3,
                            initial={"0": {"output_angle": 0.0}, "1": {"output_angle": 0.4}}, output_step=0.5e-3)
    N, R, K = 345.0, 3.0, 345.0 * 3e-3
    J, b = [N * N * 1e-8 + J_L for J_L in inertias], N * N * 1e-8
    x, d, rows, volts = np.array([0.0, 0.0, 0.4, 0.0, 1.0]), [0.0, 0.0], [], []
    for n in range(600):
        for k in range(2):
            if n % (2, 3)[k] == 0:
                d[k] = min(max(gains[k] * (goals[k] - x[2 * k]), -0.9), 0.9)
        rows.append(x[[0, 2]])
        G = np.zeros(5)  # V_bus = G x
        G[[1, 3]], G[4] = [R_b * one * K / R for one in d], V_OC
        G /= 1.0 + R_b * (d[0]**2 + d[1]**2) / R
        volts.append(G @ x)
        A = np.zeros((5, 5))
        for k in range(2):
            A[2 * k, 2 * k + 1] = 1.0
            A[2 * k + 1] = K / (R * J[k]) * d[k] * G
            A[2 * k + 1, 2 * k + 1] -= (K * K / R + b) / J[k]
        x = expm(A * 0.5e-3) @ x
    for k in range(2):
        np.testing.assert_allclose(fleet[str(k)]["output_angle"][:-1], np.array(rows)[:, k], rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(fleet.bus_voltage[:-1], volts, rtol=0.0, atol=1e-9)
    assert R_b == 0.0 or fleet.bus_voltage.min() < 0.8 * V_OC


@pytest.mark.long
def test_the_balance_of_all_closes_and_the_bus_sags_by_the_current_of_all():
    model, beside = digital(ROUGH | DROPS), digital({**ROUGH, "firmware.off_state": "diode"})
    later = st.signals.step(0.1, 1.0, at=0.05, unit="rad")
    fleet = st.simulate_bus({"a": (model, STEP, LOAD), "b": (beside, later, LOAD)}, supply=BATTERY, duration=0.4)
    np.testing.assert_allclose(fleet.bus_voltage, V_OC - R_B * fleet.supply_current, rtol=0.0, atol=1e-9)
    assert abs(fleet.energy.residual) < 1e-9 * fleet.energy.supply
    assert fleet.bus_voltage.min() < V_OC - 1.0


@pytest.mark.long
def test_a_pulse_servo_stands_beside_a_digital_one():
    analog = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    told, supply = st.signals.step(0.0, 60.0, at=0.05, unit="deg"), st.Supply(open_circuit_voltage=6.0,
                                                                             internal_resistance=0.4)
    beside = digital({**BUSY, "firmware.overload_duty": 1.0})
    fleet = st.simulate_bus({"analog": (analog, told), "digital": (beside, STEP, LOAD)}, supply=supply, duration=0.5)
    alone = st.simulate_bus({"analog": (analog, told)}, supply=supply, duration=0.5)
    np.testing.assert_allclose(fleet.bus_voltage, 6.0 - 0.4 * fleet.supply_current, rtol=0.0, atol=1e-9)
    assert abs(fleet.energy.residual) < 1e-9 * fleet.energy.supply
    assert np.abs(fleet["analog"]["output_angle"] - alone["analog"]["output_angle"]).max() > 1e-3


def test_a_neighbour_that_stalls_starves_a_servo_with_undervoltage():
    model = digital({**ROUGH, "firmware.undervoltage": 10.5, "firmware.undervoltage_action": "stop"})
    busy = digital({**ROUGH, "firmware.proportional_gain": 30.0})
    hold, heavy = st.signals.constant(0.5, unit="rad"), st.loads.Constant(3.0)
    fleet = st.simulate_bus({"holds": (model, hold), "stalls": (busy, hold, heavy)}, supply=BATTERY, duration=0.4,
                            initial={"holds": {"output_angle": 0.5}})
    alone = st.simulate_bus({"holds": (model, hold)}, supply=BATTERY, duration=0.4,
                            initial={"holds": {"output_angle": 0.5}})
    assert (fleet["holds"]["trip"] == 4).any()
    assert fleet.bus_voltage.min() < 10.5
    assert not alone["holds"]["trip"].any()


@pytest.mark.parametrize("order", ["coasts, winds, digital", "digital, coasts, winds"])
def test_servos_of_all_kinds_share_what_the_source_gives(servo, order):
    """V_bus = V_oc - R_b sum(i) at every instant, and energy is kept."""
    models = {"coasts": st.PulseServo(servo.replace({"electronics.off_state": "coast"})), "digital": digital(DROPS),
              "winds": st.PulseServoInductive(servo.replace({"motor.armature_inductance": 1e-3}))}
    fleet = st.simulate_bus({name: (models[name], STEP, LOAD) for name in order.split(", ")}, supply=BATTERY,
                            duration=0.04)
    drawn = sum(result["supply_current"] for result in fleet.values())
    np.testing.assert_allclose(fleet.bus_voltage, V_OC - R_B * drawn, rtol=0.0, atol=1e-9)
    assert abs(fleet.energy.residual) <= 1e-9 * fleet.energy.supply
    assert fleet.bus_voltage.min() < V_OC - 0.5


@pytest.mark.slow
def test_compiled_it_is_the_same(monkeypatch):
    models = [digital(SORTS[sort]) for sort in ("everything", "drops", "slow PWM")]
    servos = {str(k): (model, st.signals.step(0.1, 1.0 - 0.3 * k, at=0.02 * k, unit="rad"), LOAD)
              for k, model in enumerate(models)}
    monkeypatch.setattr(bus_run, "_frames_run", {})  # earlier fleets of this process count no more
    monkeypatch.setattr(bus_run, "LOADS_FROM", math.inf)
    plain = st.simulate_bus(servos, supply=BATTERY, duration=0.3)
    assert np.isfinite(plain.bus_voltage).all()  # found now, and kept
    for name in ("LOADS_FROM", "COMPILES_FROM"):
        monkeypatch.setattr(bus_run, name, 0)
    compiled = st.simulate_bus(servos, supply=BATTERY, duration=0.3)
    for name, result in plain.results.items():
        assert off([compiled[name]], result, result.names) < 1e-11
    np.testing.assert_array_equal(compiled.bus_voltage, plain.bus_voltage)


@pytest.mark.slow
def test_lanes_on_a_bus_are_servos_on_a_bus():
    model, told = digital(BUSY), (1.0, 0.7, -0.2)
    sims = st.VectorSimulator(model, 5, load=LOAD, bus=[(BATTERY, [0, 2, 4])])
    sims.reset(command_angle=0.1)
    sims.set(torque_enable=[True, True, True, True, False])
    for _ in range(15):  # lane 4 falls, and soon it is fast enough to feed the bus
        sims.advance(0.01, command_angle=[told[0], 0.3, told[1], 0.3, told[2]])
    saved = sims.save()
    fleet = st.simulate_bus({str(k): (model, st.signals.constant(told[k], unit="rad"), LOAD) for k in range(2)},
                            supply=BATTERY, duration=0.15, initial={str(k): {"output_angle": 0.1} for k in range(2)})
    for lane, name in ((0, "0"), (2, "1")):
        assert sims["output_angle"][lane] == pytest.approx(fleet[name]["output_angle"][-1], abs=1e-9)
    assert sims["bus_voltage"][0] == pytest.approx(sims["bus_voltage"][2])
    assert sims["duty"][4] == 0.0
    sims.advance(0.1, command_angle=told[1])
    there = sims["output_angle"].copy()
    sims.restore(saved)
    sims.advance(0.1, command_angle=told[1])
    np.testing.assert_array_equal(sims["output_angle"], there)
