"""The servos and the terms of this scenario: HS-755HBs with a spread, to which one effect is added at a time."""

from dataclasses import dataclass

import numpy as np

import servotwin as st

DURATION = 2.0  # s
CHANGES = 5  # of a command in that time
COMMANDS = 64  # different ones; a lane takes one of them

# The catalog's servo with what every row has: a horn, a supply with leads, a friction that is larger at rest
SERVO = st.load_servo("hitec-hs-755hb").replace({
    "gear.output_inertia": 1e-3, "friction.breakaway_ratio": 1.3, "supply.internal_resistance": 0.2})

_STRIBECK = {"friction.stribeck_speed": 10.0, "friction.stribeck_exponent": 1.5}
_M6 = {**_STRIBECK, "friction.load_friction_motor": 0.08, "friction.load_friction_external": 0.1,
       "friction.load_friction_motor_stribeck": 0.04, "friction.load_friction_external_stribeck": 0.05,
       "friction.load_friction_motor_quad": 0.1, "friction.load_friction_external_quad": 0.2}
_REGULATOR = {"supply.current_limit": 1.2}
_BACKLASH = {"gear.backlash": 0.01}
_HEAT = {"thermal.winding_capacity": 2.0, "thermal.housing_capacity": 60.0, "thermal.winding_to_housing": 8.0,
         "thermal.housing_to_ambient": 10.0, "thermal.magnet_coefficient": -1.5e-3}
_PLAY = {"potentiometer.backlash": 0.005}
_M5 = {"friction.load_friction_motor": 0.08, "friction.load_friction_external": 0.1}


@dataclass(frozen=True)
class Term:
    """What is added to the plain pulse servo: numbers by dotted name, and whether the armature has its inductance."""

    name: str
    numbers: dict[str, float]
    inductive: bool = False

    def model(self) -> st.PulseServo | st.PulseServoInductive:
        kind = st.PulseServoInductive if self.inductive else st.PulseServo
        return kind(SERVO.replace(self.numbers))


PLAIN = Term("plain", {})
TERMS = (
    Term("inductance", {}, inductive=True),
    Term("regulator", _REGULATOR),
    Term("M3", {"friction.load_friction": 0.08}),
    Term("M5", _M5),
    Term("Stribeck", _STRIBECK),
    Term("M4", {**_STRIBECK, "friction.load_friction": 0.08, "friction.load_friction_stribeck": 0.04}),
    Term("M6", _M6),
    Term("backlash", _BACKLASH),
    Term("heat", _HEAT),
    Term("potentiometer play", _PLAY),
    Term("inductance, M5", _M5, inductive=True),
    Term("inductance, heat", _HEAT, inductive=True),
    Term("backlash, heat", {**_BACKLASH, **_HEAT}),
    Term("all together", {**_REGULATOR, **_M6, **_BACKLASH, **_HEAT, **_PLAY}, inductive=True))


@dataclass(frozen=True)
class Population:
    """Servos, commands and loads of B lanes."""

    parameters: dict[str, np.ndarray]
    commands: list[st.signals.Signal]

    def __len__(self) -> int:
        return len(self.commands)

    def times(self, copies: int) -> "Population":
        """Return the same lanes several times over."""
        return Population({name: np.tile(x, copies) for name, x in self.parameters.items()}, self.commands * copies)


def written(factor: float) -> str:
    """Write a factor with three digits, or all of a large one."""
    return f"{factor:,.0f}" if factor >= 99.95 else f"{factor:.3g}"


def random_command(rng: np.random.Generator) -> st.signals.Signal:
    """Draw pulse widths for jumps at random times."""
    at = np.concatenate(([0.0], np.sort(rng.uniform(0.0, DURATION, CHANGES))))
    return st.signals.samples(at, rng.uniform(0.8e-3, 2.3e-3, len(at)), unit="s")


def random_population(lanes: int, seed: int = 0) -> Population:
    """Draw servos of one make, loaded with up to what their friction holds."""
    rng = np.random.default_rng(seed)

    def spread(name: str, share: float) -> np.ndarray:
        return SERVO.source(name).value * rng.uniform(1.0 - share, 1.0 + share, lanes)

    constant = spread("motor.torque_constant", 0.1)
    parameters = {
        "motor.armature_resistance": spread("motor.armature_resistance", 0.1),
        "motor.torque_constant": constant,
        "motor.back_emf_constant": constant,
        "friction.coulomb_torque_forward": spread("friction.coulomb_torque_forward", 0.3),
        "friction.coulomb_torque_backward": spread("friction.coulomb_torque_backward", 0.3),
        "electronics.stretcher_gain": spread("electronics.stretcher_gain", 0.3),
        "load.inertia": rng.uniform(0.0, 5e-3, lanes),
        "load.torque": rng.uniform(-0.2, 0.2, lanes)}
    shapes = [random_command(rng) for _ in range(COMMANDS)]
    return Population(parameters, [shapes[k] for k in rng.integers(0, COMMANDS, lanes)])
