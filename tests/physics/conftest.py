"""Invented numbers of a plausible servo; no source stands behind them, and no test needs one."""

from types import SimpleNamespace

import pytest

VALUES = {
    "armature_resistance": 3.1,
    "torque_constant": 4.0e-3,
    "back_emf_constant": 4.0e-3,
    "rotor_inertia": 1.0e-7,
    "motor_viscous_friction": 2.0e-7,
    "gear_reduction": 250.0,
    "coulomb_torque_forward": 8.0e-4,
    "coulomb_torque_backward": 1.1e-3,
    "zero_crossing_slope": 0.3,
    "bridge_gain": 8.0,
    "comparator_gain": 3.0,
    "voltage_to_pulse_gain": 1.0929e-3,
    "pulse_to_voltage_gain": 735.6,
    "feedback_gain": 0.4197,
    "command_offset": 0.1038,
    "feedback_offset": 0.5878,
}


@pytest.fixture
def values():
    return dict(VALUES)


@pytest.fixture
def p():
    return SimpleNamespace(**VALUES)
