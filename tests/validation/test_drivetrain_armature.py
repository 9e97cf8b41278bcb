"""Armature inductance against closed forms: rise, decay, ripple, plugging, freewheeling, and the limit of none."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from reference.drivetrain_cases import Case, Command
from validation.test_drivetrain_reference import simulate

N = 200.0
CENTRE = 1.5e-3  # s
SIMPLE = {
    "motor.armature_resistance": 3.0, "motor.torque_constant": 1.0 / N, "motor.back_emf_constant": 1.0 / N,
    "motor.rotor_inertia": 6e-3 / N**2, "motor.motor_viscous_friction": 0.0, "gear.gear_reduction": N,
    "friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0,
    "supply.open_circuit_voltage": 6.0, "potentiometer.feedback_gain": 0.44, "potentiometer.feedback_offset": 0.0,
    "electronics.one_shot_slope": 1.3e-3, "electronics.one_shot_offset": CENTRE, "electronics.stretcher_gain": 1e5,
    "electronics.deadband": 8e-6, "electronics.off_state": "brake",
}
LOCKED = {"friction.coulomb_torque_forward": 10.0 / N, "friction.coulomb_torque_backward": 10.0 / N}


def undriven(values=None, **words):
    """A servo without friction that gets no pulse: nothing moves it but what it starts with."""
    return Case(**{"values": SIMPLE | (values or {}), "command": Command(kind="constant", before=CENTRE),
                   "duration": 0.1, "edges": ()} | words)


def driven(values=None, *, way=1, **words):
    """One that is driven fully, by one pulse at t = 0; forward from `CENTRE` on, backward from 1.6 ms or so."""
    initial = {"output_angle": -0.2 * way} | words.pop("initial", {})
    return undriven(values, **{"edges": (0.0,), "initial": initial} | words)


def drive_start(result):
    return next(event.time for event in result.events if event.kind in ("drive forward", "drive backward"))


# --- the limit of no inductance ---------------------------------------------------------------------------------------

SMOOTH = {
    "plain": {},
    "drops": {"motor.brush_drop_voltage": 0.3, "supply.bridge_drop_voltage": 0.4,
              "supply.bridge_drop_resistance": 0.1, "supply.internal_resistance": 0.2},
    "friction": {"friction.coulomb_torque_forward": 0.1 / N, "friction.breakaway_ratio": 1.3,
                 "friction.stribeck_speed": 1.0 * N, "friction.load_friction": 0.1},
    "heat": {"thermal.winding_capacity": 0.01, "thermal.housing_capacity": 0.1, "thermal.winding_to_housing": 5.0,
             "thermal.housing_to_ambient": 10.0, "thermal.magnet_coefficient": -2e-3},
}


@pytest.mark.long(but="drops")
@pytest.mark.parametrize("name", SMOOTH)
def test_without_inductance_is_the_limit_of_a_small_one(name):
    """One drive without switching, where the start of the shaft is as late as the current: order 1 in L_a."""
    case, end = driven(SMOOTH[name], duration=0.04, load={"inertia": 1e-3, "torque": 0.05}), np.array([0.04])
    plain = simulate(case, end)["output_angle"][0]
    gap = [abs(simulate(case.replace(motor__armature_inductance=L), end)["output_angle"][0] - plain)
           for L in (4e-5, 2e-5, 1e-5)]
    assert gap[0] < 2e-3
    assert math.log2(gap[0] / gap[1]) == pytest.approx(1.0, abs=0.15)
    assert math.log2(gap[1] / gap[2]) == pytest.approx(1.0, abs=0.15)


# --- a locked shaft ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("off", "drop", "R"), [("brake", 0.3, 3.0), ("coast", 6.7, 3.5)])
@pytest.mark.parametrize("start", [0.8, -0.8])
def test_current_fades_with_L_over_R(off, drop, R, start):
    """i + a = (i_0 + a) e^(−Rt/L) until 0, a = drop/R; the diodes' way leads through the battery and its resistance."""
    L, a = 3e-4, drop / R
    case = undriven(LOCKED | {"motor.armature_inductance": L, "electronics.off_state": off,
                              "motor.brush_drop_voltage": 0.3, "supply.bridge_drop_voltage": 0.4,
                              "supply.internal_resistance": 0.5}, initial={"armature_current": start}, duration=5e-4)
    end = L / R * math.log(1.0 + abs(start) / a)
    times = np.array([0.0, 0.3, 0.8, 1.0001]) * end
    result = simulate(case, times)
    want = np.maximum((abs(start) + a) * np.exp(-R / L * times) - a, 0.0)
    np.testing.assert_allclose(result["armature_current"], math.copysign(1.0, start) * want, rtol=0.0, atol=1e-13)
    assert [event.time for event in result.events if event.kind == "current stops"] == [pytest.approx(end, rel=1e-12)]
    assert np.ptp(result["output_angle"]) == 0.0


@pytest.mark.parametrize("way", [1, -1])
def test_current_rises_with_L_over_R(way):
    L, R, V = 3e-4, 3.0 + 0.1 + 0.2, 6.0 - 0.3 - 0.4
    case = driven(LOCKED | SMOOTH["drops"] | {"motor.armature_inductance": L}, way=way, duration=0.01)
    start = drive_start(simulate(case, np.array([0.01])))
    age = np.array([0.2, 1.0, 3.0]) * L / R
    np.testing.assert_allclose(way * simulate(case, start + age)["armature_current"],
                               V / R * (1.0 - np.exp(-R / L * age)), rtol=1e-11)


def test_regular_drives_make_a_ripple():
    """Locked, braked, driven for the same time in every frame: i settles between i_1 and i_1 e^(−R t_off/L)."""
    period, on, L, R, V = 5e-3, 2e-3, 6e-3, 3.0, 6.0
    error = 1.3e-3 * 0.44 * 0.2 - 0.5 * 8e-6
    case = driven(LOCKED | {"motor.armature_inductance": L, "electronics.stretcher_gain": on / error},
                  duration=0.1, edges=tuple(period * k for k in range(40)))
    top = V / R * (1.0 - math.exp(-R / L * on)) / (1.0 - math.exp(-R / L * period))
    start = 19 * period - period + CENTRE  # of a drive, 36 time constants after the first
    result = simulate(case, start + np.array([0.0, on, period]))
    np.testing.assert_allclose(result["armature_current"],
                               [top * math.exp(-R / L * (period - on)), top, top * math.exp(-R / L * (period - on))],
                               rtol=1e-9)


# --- a turning shaft --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("inductance", [None, 1e-4])
def test_plugging_draws_up_to_twice_the_stall_current(inductance):
    """Driven against its full speed; the load's inertia keeps that speed while the current comes."""
    stall = 6.0 / 3.0
    case = driven(way=-1, initial={"output_speed": 6.0}, load={"inertia": 10.0}, duration=0.02).replace(
        motor__armature_inductance=inductance)
    result = simulate(case, np.array([0.02]))
    assert 1.97 * stall < result.peak("armature_current") <= 2.0 * stall
    # With a rotor alone the speed falls meanwhile, and the peak is lower than twice, but not less than once.
    light = simulate(replace(case, load={}), np.array([0.02]))
    assert stall < light.peak("armature_current") <= 2.0 * stall


@pytest.mark.parametrize("limit", [None, 1.0])
@pytest.mark.parametrize("off", ["brake", "coast"])
def test_freewheeling_gives_back_to_the_supply_where_the_bridge_coasts(off, limit):
    """½ L i² goes to the battery less what resistances and drops take; a brake keeps it all."""
    L, start = 2e-3, 1.5
    case = undriven(LOCKED | {"motor.armature_inductance": L, "electronics.off_state": off,
                              "motor.brush_drop_voltage": 0.3, "supply.bridge_drop_voltage": 0.4},
                    initial={"armature_current": start}, duration=0.02).replace(supply__current_limit=limit)
    energy = simulate(case, np.array([0.02])).energy
    assert energy.stored == pytest.approx(-0.5 * L * start**2, rel=1e-12)
    drop = 6.7 if off == "coast" else 0.3
    a = drop / 3.0
    charge = L / 3.0 * (start - a * math.log(1.0 + start / a))  # ∫ i dt
    assert energy.brush == pytest.approx(0.3 * charge, rel=1e-9)
    assert energy.supply == pytest.approx(-6.0 * charge if off == "coast" else 0.0, rel=1e-9)
    assert energy.bridge == pytest.approx(0.4 * charge if off == "coast" else 0.0, rel=1e-9)
    assert energy.winding == pytest.approx(0.5 * L * start**2 - drop * charge, rel=1e-9)


def test_a_fast_shaft_feeds_the_supply_only_beyond_its_voltage():
    """Open, k_b w has to exceed V_oc + V_ce0 + V_br before a current flows; braked it flows at any speed."""
    for off, speed, flows in (("coast", 6.6, False), ("coast", 6.8, True), ("brake", 0.4, True), ("brake", 0.2, False)):
        case = undriven({"motor.armature_inductance": 3e-4, "electronics.off_state": off,
                         "motor.brush_drop_voltage": 0.3, "supply.bridge_drop_voltage": 0.4},
                        initial={"output_speed": speed}, duration=1e-3)
        current = simulate(case, np.array([1e-3]))["armature_current"][0]
        assert (current < 0.0) == flows
        assert flows or current == 0.0


def test_models_without_inductance_have_no_current_to_start_with():
    with pytest.raises(st.errors.UnknownNameError, match="armature_current"):
        simulate(undriven(initial={"armature_current": 0.1}), np.array([0.1]))
