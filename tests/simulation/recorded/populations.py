"""Seeded servos, one set for each way through the compiled kernels; what comes out of them is recorded.

A set is a function that returns arrays by name, the same ones for the same kernels on the same machine. Everything is
drawn from seeds, nothing from the catalog. `nudge` multiplies some numbers of the servos: by a rounding more or less it
shows which results rounding alone moves.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

import servotwin as st
from servotwin.simulation.lanes.inputs import lanes_of
from servotwin.simulation.lanes.many import simulate_lanes
from simulation.recorded.ticks import by_c, in_mujoco, on_bus, ticked

ANALOG = {
    "motor": {"armature_resistance": 3.1, "torque_constant": 3.7e-3, "back_emf_constant": 3.8e-3,
              "rotor_inertia": 8e-8, "motor_viscous_friction": 1e-7},
    "gear": {"gear_reduction": 280.0},
    "friction": {"coulomb_torque_forward": 9e-4, "coulomb_torque_backward": 8e-4},
    "electronics": {"bridge_gain": 40.0, "comparator_gain": 0.8, "voltage_to_pulse_gain": 1.09e-3,
                    "command_pulse_offset": 0.0, "one_shot_slope": 1.36e-3, "one_shot_offset": 1e-4,
                    "pulse_to_voltage_gain": 1.0 / 1.36e-3, "command_offset": -1e-4 / 1.36e-3, "deadband": 6e-6,
                    "stretcher_gain": 80.0, "frame_period": 0.019, "off_state": "brake"},
    "potentiometer": {"feedback_gain": 0.42, "feedback_offset": 0.6},
    "supply": {"open_circuit_voltage": 6.0},
}
DIGITAL = {
    "motor": {"armature_resistance": 3.0, "torque_constant": 3e-3, "back_emf_constant": 3.1e-3, "rotor_inertia": 1e-8,
              "motor_viscous_friction": 1e-8},
    "gear": {"gear_reduction": 345.0},
    "friction": {"coulomb_torque_forward": 2e-4, "coulomb_torque_backward": 3e-4},
    "supply": {"open_circuit_voltage": 12.0},
    "firmware": {"control_period": 1e-3, "command_kind": "goal", "proportional_gain": 7.0, "derivative_gain": 0.02},
}
COUNT = 2.0 * np.pi / 4096.0

# What is added to the numbers above
COASTING = {"electronics.off_state": "coast", "electronics.back_emf_injection": 0.02,
            "electronics.supply_coupling": 0.02, "supply.internal_resistance": 0.3, "potentiometer.noise": 1e-3,
            "electronics.minimum_drive_time": 4e-4, "motor.brush_drop_voltage": 0.2, "supply.bridge_drop_voltage": 0.3,
            "supply.bridge_drop_resistance": 0.1, "friction.breakaway_ratio": 1.4,
            "electronics.stretcher_time_constant": 0.02}
SILENT = {"electronics.pulse_timeout": 0.013, "electronics.silence_state": "coast",
          "electronics.pulse_width_max": 1.8e-3, "stops.upper_angle": 1.4, "stops.restitution": 0.4}
REGULATOR = {"supply.current_limit": 1.1, "supply.internal_resistance": 0.2}
M3 = {"friction.load_friction": 0.08}
M5 = {"friction.load_friction_motor": 0.06, "friction.load_friction_external": 0.1}
STRIBECK = {"friction.breakaway_ratio": 1.3, "friction.stribeck_speed": 10.0, "friction.stribeck_exponent": 1.5}
M6 = {**STRIBECK, **M5, "friction.load_friction_motor_stribeck": 0.04,
      "friction.load_friction_external_stribeck": 0.05, "friction.load_friction_motor_quad": 0.1,
      "friction.load_friction_external_quad": 0.2}
HEAT = {"thermal.winding_capacity": 0.6, "thermal.housing_capacity": 6.0, "thermal.winding_to_housing": 10.0,
        "thermal.housing_to_ambient": 20.0, "thermal.magnet_coefficient": -1e-3}
COIL = {"motor.armature_inductance": 5e-4}
GAP = {"gear.backlash": 0.015, "gear.output_inertia": 6e-4}
WORN = {"potentiometer.backlash": 0.01}
STEPPED = {"potentiometer.quantisation": 1e-3}
EVERYTHING = {**M6, **REGULATOR, **HEAT, **GAP, **WORN, **STEPPED, **COIL,
              "potentiometer.linearity_angle": [0.0, 1.0, 2.0], "potentiometer.linearity_error": [0.0, 0.01, -0.01]}
SPRING = {"gear.stiffness": 80.0, "gear.damping": 0.02, "gear.output_inertia": 1e-3}
PROGRAM = {"firmware.integral_gain": 9.0, "firmware.integral_limit": 0.3, "firmware.compute_delay": 7e-4,
           "firmware.angle_quantum": COUNT, "firmware.deadband_angle": 2.0 * COUNT, "firmware.duty_quantum": 1e-3,
           "firmware.speed_limit": 5.0, "firmware.acceleration_limit": 80.0, "firmware.current_limit": 1.5,
           "firmware.overload_duty": 0.6, "firmware.overload_time": 0.05, "firmware.overload_output": 0.2,
           "firmware.filter_weight": 0.8, "firmware.duty_slew": 60.0}
DROPS = {"supply.internal_resistance": 0.4, "supply.bridge_drop_voltage": 0.2, "supply.bridge_drop_resistance": 0.1,
         "motor.brush_drop_voltage": 0.1}

PLAIN_LOAD = st.loads.Inertia(0.0) + st.loads.Constant(0.0)  # what the lanes' numbers belong to
PENDULUM = st.loads.Pendulum(mass=0.15, length=0.1) + PLAIN_LOAD
RECORDED = st.loads.Recorded([0.0, 0.11, 0.27, 9.0], [0.0, 0.15, -0.1, 0.1]) + PLAIN_LOAD
ON_SPRING = st.loads.Spring(0.15, 0.5) + st.loads.Viscous(2e-3) + PLAIN_LOAD
DRY = st.loads.Coulomb(0.06) + PLAIN_LOAD
ARM = st.loads.Flexible(stiffness=100.0, inertia=0.01, damping=0.01) + st.loads.Coulomb(0.02)


def model_of(changes: dict[str, Any], kind: type = st.PulseServo, nudge: float = 1.0) -> Any:
    """Return a model of the servo above, or of the digital one, with some numbers changed."""
    digital = kind is st.DigitalServo
    servo = st.servo_from_values("recorded", DIGITAL if digital else ANALOG, **({"kind": "bus"} if digital else {}))
    servo = servo.replace(changes)
    if nudge != 1.0:
        servo = servo.replace({name: servo.source(name).value * nudge for name in (
            "motor.torque_constant", "gear.gear_reduction")})
    return kind(servo)


def spread(rng: np.random.Generator, lanes: int, digital: bool, nudge: float) -> dict[str, np.ndarray]:
    """Return numbers of lanes, of the servos and of their loads."""
    values = DIGITAL if digital else ANALOG
    around = {"motor.armature_resistance": 0.15, "motor.back_emf_constant": 0.05,
              "friction.coulomb_torque_forward": 0.4, "friction.coulomb_torque_backward": 0.4}
    around |= {"firmware.proportional_gain": 0.4} if digital else {"electronics.stretcher_gain": 0.4}
    found = {}
    for name, share in around.items():
        group, key = name.split(".")
        found[name] = values[group][key] * rng.uniform(1.0 - share, 1.0 + share, lanes)
    found["motor.armature_resistance"] *= nudge
    found["load.inertia"] = rng.uniform(5e-4, 6e-3, lanes)
    found["load.torque"] = rng.uniform(-0.2, 0.2, lanes)
    return found


def commands(rng: np.random.Generator, lanes: int, duration: float, digital: bool) -> list[Any]:
    """Return a command for each lane, that jumps at random times."""
    found = []
    for _ in range(lanes):
        at = np.concatenate(([0.0], np.sort(rng.uniform(0.0, 0.9 * duration, 3))))
        found.append(st.signals.samples(at, rng.uniform(-0.8, 1.0, 4), unit="rad") if digital
                     else st.signals.samples(at, rng.uniform(0.9e-3, 2.1e-3, 4), unit="s"))
    return found


def many(changes: dict[str, Any], kind: type = st.PulseServo, load: Any = PLAIN_LOAD, lanes: int = 32,
         duration: float = 0.5, seed: int = 1, more: dict[str, Any] | None = None, given: Any = None,
         nearly: bool = False, **options: Any) -> Callable[..., dict[str, np.ndarray]]:
    """Return what runs lanes by `simulate_many`, or as a fit searches; all signals, status and how they end.

    `more` are numbers of lanes by name, and `given` a command for all lanes.
    """
    def run(nudge: float = 1.0, **how: Any) -> dict[str, np.ndarray]:
        rng, digital = np.random.default_rng(seed), kind is st.DigitalServo
        model = model_of(changes, kind, nudge)
        numbers = spread(rng, lanes, digital, nudge)
        if kind in (st.BoundedServo, st.AveragedServo):
            del numbers["electronics.stretcher_gain"]
        told = given if given is not None else commands(rng, lanes, duration, digital)
        numbers |= {name: np.resize(values, lanes) for name, values in (more or {}).items()}
        start = float(model.start_angle(0.0 if digital else 1.5e-3)) if kind is not st.BoundedServo else 0.6
        asked = {"duration": duration, "output_times": duration * np.sort(rng.uniform(0.0, 1.0, 12)),
                 "outputs": model.signals_with(load), **options, **how}
        initial = {"output_angle": start + rng.uniform(-0.3, 0.3, lanes)}
        batch = (simulate_lanes(lanes_of(model, told, [load] * lanes, numbers, initial, np.arange(lanes) + 5), **asked,
                                nearly=True) if nearly else
                 st.simulate_many(model, told, load=load, parameters=numbers, seeds=np.arange(lanes) + 5,
                                  initial=initial, **asked))
        found = {name: batch[name] for name in model.signals_with(load)}
        remarks = [(lane, sum(map(ord, kind)), time) for lane, kind, time in batch.remarks]
        return found | {"status": batch.status, "remarks": np.array(remarks).reshape(-1, 3)}
    return run


TRAIN = st.signals.pulse_train([0.003 + 0.018 * k + 0.001 * (k % 3) for k in range(18)],
                               [1900.0, 1250.0, 1500.0, 1700.0] * 4 + [1000.0, 1600.0])
CHIRP = st.signals.chirp(mean=1500.0, amplitude=300.0, start_frequency=1.0, end_frequency=8.0, duration=0.5, unit="us")
MIXED = {"electronics.off_state": ["brake", "coast"], "load.spring.stiffness": [0.0, 0.0, 0.1],
         "friction.load_friction": [0.0, 0.0, 0.0, 0.0, 0.08]}
PULSE, INDUCTIVE, BOUNDED, PROGRAMMED = st.PulseServo, st.PulseServoInductive, st.BoundedServo, st.DigitalServo

LANES = {
    "plain": many({}),
    "plain, float32": many({}, dtype="float32"),
    "plain, longer": many({"friction.breakaway_ratio": 1.3}, load=DRY, lanes=40, duration=1.0),
    "coasting, coupled, noisy": many(COASTING),
    "coasting, coupled, noisy, float32": many(COASTING, dtype="float32"),
    "silent, stopped": many(SILENT, load=DRY),
    "pulses at any time": many({}, given=TRAIN),
    "worn potentiometer": many(WORN),
    "worn potentiometer, coasting": many({**WORN, "electronics.off_state": "coast"}),
    "regulator": many(REGULATOR),
    "M3": many(M3),
    "M5": many(M5, load=DRY),
    "Stribeck": many(STRIBECK),
    "M6": many(M6, load=DRY),
    "heat": many(HEAT),
    "pendulum": many({}, load=PENDULUM),
    "spring": many(SILENT, load=ON_SPRING),
    "heat, M3 and a regulator": many({**HEAT, **M3, **REGULATOR}),
    "spring and M5": many(M5, load=ON_SPRING),
    "inductance": many(COIL, INDUCTIVE),
    "inductance and M5": many({**COIL, **M5}, INDUCTIVE, DRY),
    "inductance, coasting": many(COIL | COASTING, INDUCTIVE, DRY),
    "play": many(GAP),
    "play and heat": many({**GAP, **HEAT}),
    "play and M5": many(GAP | M5, load=DRY),
    "play, quantised": many(GAP | STEPPED),
    "recorded load": many({}, load=RECORDED),
    "recorded load, pendulum": many(SILENT, load=RECORDED + st.loads.Pendulum(mass=0.1, length=0.1)),
    "chirp": many({}, given=CHIRP),
    "everything": many(EVERYTHING, INDUCTIVE, RECORDED, 24, 0.3),
    "lanes of many ways": many({}, load=st.loads.Spring(0.1) + PLAIN_LOAD, more=MIXED, lanes=40),
    "bounded": many({}, BOUNDED),
    "bounded, pendulum": many({"electronics.voltage_deadband": 0.02}, BOUNDED, PENDULUM),
    "program": many({}, PROGRAMMED),
    "program, drops": many(PROGRAM | DROPS, PROGRAMMED),
    "program, diode": many(PROGRAM | DROPS | {"firmware.off_state": "diode"}, PROGRAMMED, DRY),
    "program, pendulum, nearly": many(PROGRAM, PROGRAMMED, PENDULUM, nearly=True),
    "program, M6, heat, play": many(PROGRAM | M6 | HEAT | GAP, PROGRAMMED, lanes=24, duration=0.3),
    "elastic": many(SPRING, lanes=24, load=DRY),
    "elastic arm": many({}, load=ARM + PLAIN_LOAD, lanes=24),
    "elastic, program": many(SPRING | PROGRAM, PROGRAMMED, lanes=24, duration=0.3),
}

TICKS = {
    "ticks": ticked(model_of, {}, PULSE, PLAIN_LOAD, spread),
    "ticks, float32": ticked(model_of, {}, PULSE, PLAIN_LOAD, spread, dtype="float32"),
    "ticks, coasting": ticked(model_of, COASTING, PULSE, DRY, spread),
    "ticks, regulator": ticked(model_of, REGULATOR, PULSE, PLAIN_LOAD, spread),
    "ticks, M6": ticked(model_of, M6, PULSE, PLAIN_LOAD, spread),
    "ticks, pendulum": ticked(model_of, {}, PULSE, PENDULUM, spread),
    "ticks, spring and M5": ticked(model_of, M5, PULSE, ON_SPRING, spread),
    "ticks, inductance": ticked(model_of, COIL, INDUCTIVE, PLAIN_LOAD, spread),
    "ticks, play": ticked(model_of, GAP, PULSE, PLAIN_LOAD, spread),
    "ticks, quantised play": ticked(model_of, GAP | STEPPED, PULSE, PLAIN_LOAD, spread),
    "ticks, recorded": ticked(model_of, {}, PULSE, RECORDED, spread),
    "ticks, recorded, pendulum": ticked(model_of, {}, PULSE, RECORDED + PENDULUM, spread),
    "ticks, everything": ticked(model_of, EVERYTHING, INDUCTIVE, RECORDED, spread),
    "ticks, bounded": ticked(model_of, {}, BOUNDED, PLAIN_LOAD, spread),
    "ticks, averaged": ticked(model_of, {"friction.zero_crossing_slope": 5.0}, st.AveragedServo, PLAIN_LOAD, spread),
    "ticks, program": ticked(model_of, {}, PROGRAMMED, PLAIN_LOAD, spread),
    "ticks, program, drops, heat": ticked(model_of, PROGRAM | DROPS | HEAT, PROGRAMMED, PLAIN_LOAD, spread),
    "ticks, elastic": ticked(model_of, SPRING, PULSE, PLAIN_LOAD, spread),
    "ticks, elastic, program": ticked(model_of, SPRING, PROGRAMMED, PLAIN_LOAD, spread),
}

BATTERY = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.4)
LIMITED = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.2, current_limit=1.4)
TWELVE = st.Supply(open_circuit_voltage=12.0, internal_resistance=0.7)
ON_ONE_SUPPLY = {key: COASTING[key] for key in COASTING if not key.startswith("supply.internal")}

BUSES = {
    "bus": on_bus(model_of, {}, PULSE, DRY, BATTERY),
    "bus, coasting": on_bus(model_of, ON_ONE_SUPPLY, PULSE, PLAIN_LOAD, BATTERY),
    "bus, inductance, regulator": on_bus(model_of, COIL, INDUCTIVE, PLAIN_LOAD, LIMITED),
    "bus, play, pendulum, heat": on_bus(model_of, GAP | M5 | HEAT, PULSE, PENDULUM, BATTERY),
    "bus, program": on_bus(model_of, PROGRAM, PROGRAMMED, PLAIN_LOAD, TWELVE),
    "ticks on a bus": ticked(model_of, {}, PULSE, PLAIN_LOAD, spread, bus=BATTERY),
    "ticks on a bus, inductance": ticked(model_of, COIL, INDUCTIVE, PLAIN_LOAD, spread, bus=LIMITED),
    "ticks on a bus, play, spring": ticked(model_of, GAP, PULSE, ON_SPRING, spread, bus=BATTERY),
    "ticks on a bus, program": ticked(model_of, PROGRAM, PROGRAMMED, PLAIN_LOAD, spread, bus=TWELVE),
}

FROM_C = {
    "from C": by_c(model_of, {}, PULSE, PLAIN_LOAD, spread),
    "from C, play": by_c(model_of, GAP, PULSE, PLAIN_LOAD, spread),
    "from C, everything": by_c(model_of, EVERYTHING, INDUCTIVE, PLAIN_LOAD, spread),
    "from C, program": by_c(model_of, PROGRAM, PROGRAMMED, PLAIN_LOAD, spread),
    "from C, bus": by_c(model_of, {}, PULSE, PLAIN_LOAD, spread, bus=BATTERY),
}

JOINTS = {
    "joints in MuJoCo": in_mujoco(model_of, {"j0": ({}, BOUNDED), "j1": ({}, PULSE), "j2": (GAP, PULSE)}),
    "joints in MuJoCo, program": in_mujoco(model_of, {"j0": (PROGRAM, PROGRAMMED), "j1": ({}, PROGRAMMED),
                                                      "j2": ({}, PROGRAMMED)}),
}
SETS = LANES | TICKS | BUSES | FROM_C | JOINTS
