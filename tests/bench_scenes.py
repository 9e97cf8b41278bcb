"""Random benches, and what is done at them."""

import random
from collections.abc import Sequence

from servotwin.errors import ServotwinError
from servotwin.parameters import catalog_names
from servotwin.web.live import LiveBench, Scene, SceneServo
from servotwin.web.live.actions import Action
from servotwin.web.live.live_bench import models_of
from servotwin.web.live.scene import SERVO_MODELS

LOADS = {"inertia": (0.0, 2e-3), "viscous_friction": (0.0, 1e-2), "torque": (-0.2, 0.2), "coulomb_torque": (0.0, 0.05),
         "mass": (0.0, 0.2), "arm": (0.01, 0.3), "hanging_angle": (-3.0, 3.0)}
NUMBERS = ("electronics.deadband", "electronics.stretcher_gain", "electronics.stretcher_time_constant",
           "friction.coulomb_torque_forward", "gear.backlash", "motor.rotor_inertia", "motor.armature_resistance",
           "supply.internal_resistance", "supply.open_circuit_voltage", "firmware.proportional_gain",
           "firmware.derivative_gain", "potentiometer.noise", "stops.upper_angle", "friction.breakaway_ratio",
           "firmware.torque_limit", "no.such")
REGISTERS = ("P_Coefficient", "Torque_Limit", "Minimum_Startup_Force", "Integral_Limit", "Position_P_Gain", "P_Gain",
             "Minimum_Velocity_Limit")  # no two of them make one number


ON_A_SUPPLY = SERVO_MODELS[3:]  # models that may share one


def drawn(seed: int, servos: int = 0, kinds: Sequence[str] = ()) -> dict:
    """Return a bench and what is done at it, as the harness takes it."""
    rng = random.Random(seed)
    found = []
    count = servos or rng.choice((1, 1, 2, 3))
    kinds = kinds or rng.choice((SERVO_MODELS, SERVO_MODELS[3:5], SERVO_MODELS[5:]))
    while len(found) < count:
        servo = SceneServo(id=rng.choice(catalog_names()), model=rng.choice(kinds))
        try:
            models_of(Scene(servos=(servo,)))
        except ServotwinError:
            continue
        found.append(servo)
    kinds = {servo.model for servo in found}
    pulsed = kinds <= {"PulseServo", "PulseServoInductive"}
    supply: dict[str, float] = {}
    if kinds <= set(ON_A_SUPPLY) and rng.random() < 0.5:
        supply = {"open_circuit_voltage": rng.uniform(5.0, 7.0), "internal_resistance": rng.uniform(0.1, 1.0)}
        supply |= {"current_limit": rng.uniform(1.0, 4.0)} if rng.random() < 0.3 else {}
    load = {name: rng.uniform(*ends) for name, ends in LOADS.items() if rng.random() < 0.4}
    control: dict[str, float] = {}
    if pulsed and not supply and rng.random() < 0.3:
        control = {"command_share": rng.random(), "reference_share": 0.5 * rng.random(), "sampling_delay": 1e-3}
    first = Action(0.0, "command", {"shape": "hold", "unit": "V", "value": rng.uniform(1.2, 1.6)})
    scene = Scene(servos=tuple(found), seed=rng.randrange(1000), frame_rate=rng.choice((50.0, 50.0, 100.0, 31.7)),
                  load={"inertia": 1e-4} | load, supply=supply, control=control, actions=(first,) if control else ())
    until, steps = 0.0, []
    for _ in range(rng.randint(3, 8)):
        until += rng.choice((0.0, 0.013, 0.02, 0.1, 0.25))
        kind, value = action(rng)
        steps.append({"until": until, "kind": kind, "value": value,
                      "servo": rng.randrange(len(found)) if rng.random() < 0.3 else None})
    steps.append({"until": until + 0.3, "kind": None})
    return {"scene": scene.text(), "steps": steps, "rate": rng.choice((60.0, 180.0, 1000.0)),
            "switches": rng.random() < 0.7}


def action(rng: random.Random) -> tuple[str, object]:
    """Return a kind of action and a value, some of which are refused."""
    kind = rng.choice(("command", "command", "command", "set", "set", "push", "frames", "torque", "register",
                       "control"))
    if kind == "command":
        return kind, command(rng)
    if kind == "push":
        return kind, rng.choice((rng.uniform(-0.2, 0.2), 0.0, 2e3))
    if kind == "frames":
        return kind, rng.choice(({"rate": rng.uniform(20.0, 300.0)}, {"lost": rng.random()}, {"rate": 1.0, "lost": 1.0},
                                 {"lost": 2.0}, {"rate": 900.0}))
    if kind == "control":
        return kind, rng.choice(({"command_share": rng.random()}, {"sampling_delay": 2e-3}, {"sampling_delay": 0.5},
                                 {"command_share": 2.0}))
    if kind == "register":
        return kind, {rng.choice(REGISTERS): rng.randint(0, 300)}
    if kind == "torque":
        return kind, rng.random() < 0.5
    if rng.random() < 0.5:
        name = rng.choice(("load.inertia", "load.torque", "load.viscous_friction", "load.coulomb_torque",
                           "load.pendulum.mass", "load.pendulum.length"))
        return kind, {name: rng.choice((rng.uniform(0.0, 0.1), 0.0, -0.01))}
    name = rng.choice(NUMBERS)
    usual = {"gear.backlash": 0.02, "supply.open_circuit_voltage": 5.0, "electronics.stretcher_gain": 10.0,
             "motor.armature_resistance": 4.0, "motor.rotor_inertia": 1e-7, "electronics.deadband": 2e-5,
             "electronics.stretcher_time_constant": 5e-3, "friction.coulomb_torque_forward": 2e-4,
             "firmware.proportional_gain": 4.0, "firmware.derivative_gain": 0.05, "potentiometer.noise": 1e-3,
             "friction.breakaway_ratio": 1.2, "firmware.torque_limit": 0.6}.get(name, 1.0)
    return kind, {name: rng.choice((1.0, 1.0, 1.0, -1.0)) * usual * rng.uniform(0.8, 1.2)}


def command(rng: random.Random) -> dict:
    """Return a command, of a unit that some servos do not take."""
    unit = rng.choice(("us", "us", "deg", "deg", "V"))
    middle, swing = {"us": (1500.0, 200.0), "deg": (40.0, 30.0), "V": (1.4, 0.3)}[unit]
    low, high = middle - swing * rng.random(), middle + swing * rng.random()
    shape = rng.choice(("hold", "hold", "step", "sine", "sweep", "staircase", "recorded"))
    given = {
        "hold": {"value": rng.choice((high, high, high if unit == "V" else 1e4))},
        "step": {"low": low, "high": high, "period": rng.choice((0.0, 0.2))},
        "sine": {"mean": middle, "amplitude": swing * rng.random(),
                 "frequency": rng.choice((rng.uniform(0.5, 4.0), 0.0))},
        "sweep": {"mean": middle, "amplitude": swing * rng.random(), "start_frequency": 0.5, "end_frequency": 4.0,
                  "duration": rng.uniform(0.2, 1.0)},
        "staircase": {"low": low, "high": high, "steps": rng.choice((1, 3, 5, 2000)), "dwell": 0.05},
        "recorded": {"time": [0.0, 0.1, 0.25], "value": [low, high, middle][:rng.choice((3, 3, 3, 2))],
                     "hold": rng.choice(("previous", "linear"))}}[shape]
    return {"shape": shape, "unit": unit, **given}


def by_python(job: dict) -> dict:
    """Return what shows of the same bench at the server."""
    from servotwin.web.live import read_scene

    bench = LiveBench(read_scene(job["scene"]))
    rows, pulses, events, refused = [[] for _ in bench.models], [[] for _ in bench.models], [], []
    for step in job["steps"]:
        try:
            while bench.due or not bench.reached(step["until"]):
                push = bench.advance(step["until"], job["rate"], switches=job["switches"])
                for k, one in enumerate(push.servos):
                    rows[k] += one.points
                    pulses[k] += one.pulses
                events += push.events
            if step["kind"] is not None:
                bench.do(step["kind"], step["value"], step.get("servo"))
        except ServotwinError as error:
            refused.append(" ".join(str(error).split()))
            if step["kind"] is None or not bench.reached(step["until"]):
                break
    return {"rows": rows, "pulses": pulses, "events": events, "refused": refused, "text": bench.scene().text(),
            "time": bench.time}
