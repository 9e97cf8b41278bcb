"""The random servos of this scenario: every lane another servo, load and command, so that no two keep step."""

from dataclasses import dataclass

import numpy as np

import servotwin as st

FRAME = 0.02  # s
CHANGES = 2.5  # of a command in a second
COMMANDS = 64  # different ones; a lane takes one of them
REDUCTION = 280.0

SERVO = st.servo_from_values("benchmark", {
    "motor": {"armature_resistance": 3.0, "torque_constant": 3.7e-3, "back_emf_constant": 3.7e-3,
              "rotor_inertia": 7.7e-8, "motor_viscous_friction": 1e-8},
    "gear": {"gear_reduction": REDUCTION},
    "friction": {"coulomb_torque_forward": 7e-4, "coulomb_torque_backward": 7e-4, "breakaway_ratio": 1.2},
    "potentiometer": {"feedback_gain": 0.42, "feedback_offset": 0.588},
    "electronics": {"frame_period": FRAME, "deadband": 8e-6, "stretcher_gain": 60.0, "minimum_drive_time": 1e-4,
                    "off_state": "brake", "one_shot_offset": -0.163e-3, "one_shot_slope": 1.36e-3},
    "supply": {"open_circuit_voltage": 6.0, "internal_resistance": 0.1, "bridge_drop_voltage": 0.4,
               "bridge_drop_resistance": 0.1}})


@dataclass(frozen=True)
class Fleet:
    """B random servos: their parameters by dotted name, their commands, and where they start."""

    parameters: dict[str, np.ndarray]
    times: np.ndarray  # (COMMANDS, changes + 1): when a command changes [s]
    widths: np.ndarray  # (COMMANDS, changes + 1): and to what [s]
    command: np.ndarray  # (B,): which one a lane has
    angle: np.ndarray  # (B,): at t = 0 [rad]

    def __len__(self) -> int:
        return len(self.command)

    def signals(self) -> list[st.signals.Signal]:
        """The command of each lane; lanes share the object where they share the command."""
        shapes = [st.signals.samples(t, y, unit="s") for t, y in zip(self.times, self.widths, strict=True)]
        return [shapes[i] for i in self.command]

    def pulses(self, frames: int) -> np.ndarray:
        """The pulse width of every frame and lane [s], shape (frames, B)."""
        edges = np.arange(frames) * FRAME
        rows = [y[np.searchsorted(t, edges, side="right") - 1] for t, y in zip(self.times, self.widths, strict=True)]
        return np.ascontiguousarray(np.array(rows)[self.command].T)


def random_fleet(lanes: int, seed: int = 0, duration: float = 2.0) -> Fleet:
    """Draw servos of the 40 g class.

    Three in four have a bipolar bridge (constant drop) and a load torque that their friction can hold. The rest have a
    bridge without a constant drop and up to 1.5 times that torque, so that they creep back under brake.
    Thus no motor is ever driven by its load faster than by its supply, and the peers need not know that mode.
    """
    rng = np.random.default_rng(seed)

    def between(low: float, high: float) -> np.ndarray:
        return rng.uniform(low, high, lanes)

    forward, backward = between(0.05, 0.25), between(0.05, 0.25)  # N m, at the output
    creeping = rng.random(lanes) < 0.25
    torque = np.where(creeping, 1.5, 0.95) * np.minimum(forward, backward) * between(-1.0, 1.0)
    constant = between(0.45, 1.1) / REDUCTION
    parameters = {
        "motor.armature_resistance": between(2.0, 5.0),
        "motor.torque_constant": constant,
        "motor.back_emf_constant": constant * between(1.0, 1.1),
        "motor.rotor_inertia": between(3e-3, 1.2e-2) / REDUCTION**2,
        "motor.motor_viscous_friction": between(0.0, 0.01) / REDUCTION**2,
        "friction.coulomb_torque_forward": forward / REDUCTION,
        "friction.coulomb_torque_backward": backward / REDUCTION,
        "friction.breakaway_ratio": between(1.0, 1.5),
        "potentiometer.feedback_gain": between(0.38, 0.46),
        "electronics.deadband": between(4e-6, 10e-6),
        "electronics.stretcher_gain": between(40.0, 120.0),
        "electronics.minimum_drive_time": between(0.0, 5e-4),
        "electronics.one_shot_offset": between(-0.2e-3, -0.1e-3),
        "electronics.one_shot_slope": between(1.2e-3, 1.5e-3),
        "supply.open_circuit_voltage": between(4.8, 7.4),
        "supply.internal_resistance": between(0.0, 0.3),
        "supply.bridge_drop_voltage": np.where(creeping, 0.0, between(0.2, 0.4)),
        "supply.bridge_drop_resistance": between(0.05, 0.3),
        "load.inertia": between(0.0, 5e-3),
        "load.torque": torque}
    shape = (COMMANDS, 1 + max(1, round(CHANGES * duration)))
    times = np.sort(rng.uniform(0.0, duration, shape), axis=1)
    times[:, 0] = 0.0
    widths = rng.uniform(0.7e-3, 2.3e-3, shape)
    return Fleet(parameters, times, widths, rng.integers(0, COMMANDS, lanes), between(0.3, 2.5))


COLUMNS = ("push", "drive_rate", "brake_rate", "forward", "backward", "breakaway", "torque", "slope", "offset",
           "half_deadband", "gain", "minimum")


def columns(fleet: Fleet) -> dict[str, np.ndarray]:
    """What the peers read of a lane: accelerations [rad/s²], rates [1/s] and the chip's numbers in SI."""
    x = fleet.parameters
    N = REDUCTION
    J = N**2 * x["motor.rotor_inertia"] + x["load.inertia"]
    K, K_b = N * x["motor.torque_constant"], N * x["motor.back_emf_constant"]
    b = N**2 * x["motor.motor_viscous_friction"]
    R_a = x["motor.armature_resistance"]
    R = R_a + x["supply.bridge_drop_resistance"] + x["supply.internal_resistance"]
    slope = x["electronics.one_shot_slope"]
    b_o = 0.588
    return {
        "push": K * (x["supply.open_circuit_voltage"] - x["supply.bridge_drop_voltage"]) / (R * J),
        "drive_rate": (K * K_b / R + b) / J,
        "brake_rate": (K * K_b / R_a + b) / J,
        "forward": N * x["friction.coulomb_torque_forward"] / J,
        "backward": N * x["friction.coulomb_torque_backward"] / J,
        "breakaway": x["friction.breakaway_ratio"],
        "torque": x["load.torque"] / J,
        "slope": slope * x["potentiometer.feedback_gain"],
        "offset": x["electronics.one_shot_offset"] + slope * b_o,
        "half_deadband": 0.5 * x["electronics.deadband"],
        "gain": x["electronics.stretcher_gain"],
        "minimum": x["electronics.minimum_drive_time"]}
