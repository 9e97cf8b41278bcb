"""The energy balance at extremes: motions that settle in less than their time of day can tell, and others."""

import dataclasses

import pytest

import servotwin as st

SERVO = st.load_servo("hitec-hs-755hb")
STEP = st.signals.step(0.0, 60.0, at=0.1, unit="deg")
LIGHT = {"motor.rotor_inertia": 1e-15}
EXTREMES = {  # what changes, and relative to what is turned over, how well it has to balance
    "rotor of 1e-10 kg m2": ({"motor.rotor_inertia": 1e-10}, None, 1e-11),
    "rotor of 1e-15 kg m2": (LIGHT, None, 1e-11),
    "rotor of 1e-23 kg m2": ({"motor.rotor_inertia": 1e-23}, None, 1e-11),
    "rotor of 1e-60 kg m2": ({"motor.rotor_inertia": 1e-60}, None, 1e-11),
    "resistance of 1e-3 ohm": ({"motor.armature_resistance": 1e-3}, None, 1e-9),
    "resistance of 1e-6 ohm": ({"motor.armature_resistance": 1e-6}, None, 1e-6),  # as far as speed tells the current
    "no reduction": ({"gear.gear_reduction": 1.0}, None, 1e-11),
    "reduction of 1e9": ({"gear.gear_reduction": 1e9}, None, 1e-11),
    "stiff spring": ({}, st.loads.Spring(1e6), 1e-11),
    "light load": ({}, st.loads.Inertia(1e-30), 1e-11),
    "grease on both sides": ({"motor.motor_viscous_friction": 1e-6},
                             st.loads.Viscous(0.03) + st.loads.Coulomb(0.05) + st.loads.Inertia(2e-3), 1e-11),
}


@pytest.mark.long(but="resistance of 1e-3 ohm-BoundedServo")
@pytest.mark.parametrize("kind", [st.PulseServo, st.BoundedServo])
@pytest.mark.parametrize("case", EXTREMES)
def test_energy_ends_and_balances(case, kind):
    changes, load, within = EXTREMES[case]
    result = st.simulate(kind(SERVO.replace(changes)), STEP, load=load, duration=0.5, output_times=[0.5])
    energy = result.raise_if_failed().energy
    turnover = abs(energy.supply) + energy.winding + energy.friction + abs(energy.load) + abs(energy.stored)
    assert abs(energy.residual) <= within * turnover
    assert energy.winding > 0.0
    assert result.step_metrics().peak_current > 0.0


@pytest.mark.parametrize("kind", [st.PulseServo, st.BoundedServo])
def test_a_rotor_without_inertia_is_the_limit_of_light_ones(kind):
    """Below some inertia nothing of it is left in the balance: heat and work are those of the next lighter one."""
    def parts(inertia):
        model = kind(SERVO.replace({"motor.rotor_inertia": inertia}))
        return dataclasses.asdict(st.simulate(model, STEP, duration=0.5).energy)

    assert parts(1e-23) == pytest.approx(parts(1e-15), rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("kind", [st.PulseServo, st.BoundedServo])
@pytest.mark.parametrize("resistance", [1e-15, 1e-300])
def test_energy_ends_where_speed_does_not_tell_the_current(kind, resistance):
    result = st.simulate(kind(SERVO.replace({"motor.armature_resistance": resistance})), STEP, duration=0.2)
    assert result.energy.friction > 0.0


@pytest.mark.long(but="0.00016")
@pytest.mark.parametrize("inductance", [3e-7, 2e-6, 1.6e-4, 5e-3])
def test_energy_balances_while_a_winding_warms(inductance):
    """However fast the current fades within a step that follows the warming."""
    heat = {"thermal.winding_capacity": 20.0, "thermal.housing_capacity": 5.0, "thermal.winding_to_housing": 10.0,
            "thermal.housing_to_ambient": 3.0, "thermal.magnet_coefficient": -1e-3}
    model = st.PulseServoInductive(SERVO.replace(heat | {"motor.armature_inductance": inductance}))
    energy = st.simulate(model, STEP, load=st.loads.Inertia(1e-3), duration=0.3).energy
    assert abs(energy.residual) <= 1e-11 * energy.supply
