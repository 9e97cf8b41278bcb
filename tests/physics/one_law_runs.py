"""Servos that together use every law of the engine, plainly and as lanes of a batch whose kernels are not compiled.

Run as a script in a process of its own, it keeps all signals and tells which laws each case has called plainly:
`one_law_runs.py out.npz derived` runs all cases that there are batches of, both ways; `one_law_runs.py out.npz plain
tiles coasting` these cases, plainly alone; `one_law_runs.py out.npz compiled loaded` this one, its kernels compiled;
and `one_law_runs.py out.npz laws drive_time` calls laws by themselves, compiled.
"""

import json
import sys
import warnings
from dataclasses import astuple
from functools import cache, partial

import numpy as np

ON_A_BUS = "on a bus"
POINTS = 40  # at which a law is compared with itself, compiled
POSITIVE = ("stribeck_speed",)  # of whose logarithm a law is made
TICKS, TICK = 15, 7e-3  # s
SECONDS = 0.11  # five frames: a drive, its end, plugging back
PULSES = {"electronics.back_emf_injection": 0.01, "electronics.supply_coupling": 0.02, "potentiometer.noise": 1e-3,
          "electronics.stretcher_time_constant": 0.02, "electronics.minimum_drive_time": 2e-4,
          "motor.brush_drop_voltage": 0.1, "supply.internal_resistance": 0.2, "supply.bridge_drop_voltage": 0.3,
          "supply.bridge_drop_resistance": 0.1, "friction.breakaway_ratio": 1.2}
COASTING = {**PULSES, "electronics.off_state": "coast"}
SENSED = {"potentiometer.backlash": 0.01, "potentiometer.quantisation": 1e-3,
          "potentiometer.linearity_angle": [0.0, 1.0, 2.0], "potentiometer.linearity_error": [0.0, 0.01, -0.01]}
LOADED = {"gear.backlash": 0.02, "gear.output_inertia": 1e-3, "friction.stribeck_speed": 10.0,
          "friction.load_friction_motor": 0.06, "friction.load_friction_external": 0.1,
          "friction.load_friction_motor_stribeck": 0.05, "friction.load_friction_motor_quad": 0.1,
          "friction.load_friction_external_quad": 0.2, "stops.upper_angle": 0.35, "stops.restitution": 0.4,
          "thermal.winding_capacity": 0.5, "thermal.housing_capacity": 5.0, "thermal.winding_to_housing": 10.0,
          "thermal.housing_to_ambient": 20.0, "thermal.magnet_coefficient": -1e-3}
INDUCTIVE = {"motor.armature_inductance": 5e-4}
# An acceleration at which 1 % of the braking distance is a tick sooner or later
PROGRAM = {"firmware.control_period": 2e-3, "firmware.proportional_gain": 9.0, "firmware.derivative_gain": 0.03,
           "firmware.integral_gain": 20.0, "firmware.filter_weight": 0.7, "firmware.angle_quantum": 1.1e-3,
           "firmware.deadband_angle": 2.5e-3, "firmware.minimum_duty": 0.03, "firmware.duty_quantum": 1e-3,
           "firmware.current_limit": 0.9, "firmware.pulse_resolution": 1.7e-6, "firmware.acceleration_limit": 300.0,
           "motor.brush_drop_voltage": 0.1, "supply.internal_resistance": 0.2, "supply.bridge_drop_voltage": 0.3,
           "supply.bridge_drop_resistance": 0.1}
CHOPPED = {**PROGRAM, "firmware.off_state": "coast", "firmware.current_sense": "bus", "firmware.whole_counts": "yes"}
MEAN = {"electronics.bridge_gain": 40.0, "electronics.comparator_gain": 1.0, "electronics.voltage_deadband": 0.01,
        "electronics.pulse_to_voltage_gain": 735.0, "electronics.command_offset": 0.1,
        "electronics.voltage_to_pulse_gain": 1.09e-3, "friction.zero_crossing_slope": 0.5}


def cases(st):
    """Return (model, command, load, whether a batch takes it) by name."""
    servo = st.load_servo("hitec-hs-755hb")
    step = st.signals.step(10.0, 50.0, at=0.005, unit="deg")
    volts = st.signals.step(0.7, 1.1, at=0.005, unit="V")
    pulses = st.signals.step(700.0, 1200.0, at=0.005, unit="us")
    wave = st.signals.sine(mean=2.0, amplitude=4.0, frequency=20.0, unit="V")
    swinging = st.loads.Pendulum(mass=0.1, length=0.1) + st.loads.Spring(stiffness=0.1, rest_angle=0.3)
    dragging = st.loads.Viscous(1e-3) + st.loads.Constant(0.05) + st.loads.Coulomb(0.01)
    return {
        "tiles": (st.PulseServo(servo), step, st.loads.Inertia(1e-3), True),
        "tiles that measure": (st.PulseServo(servo.replace(PULSES)), volts, dragging, True),
        "coasting": (st.PulseServo(servo.replace({**COASTING, **SENSED})), step, None, True),
        "loaded": (st.PulseServo(servo.replace({**PULSES, **LOADED, **SENSED})), pulses, swinging + dragging, True),
        "regulated": (st.PulseServo(servo.replace({**PULSES, "supply.current_limit": 0.8})), step, dragging, True),
        "inductive": (st.PulseServoInductive(servo.replace({**COASTING, **INDUCTIVE})), step, dragging, True),
        "digital": (st.DigitalServo(servo.replace(PROGRAM)), pulses, dragging, True),
        "chopped": (st.DigitalServo(servo.replace(CHOPPED)), pulses, swinging, True),
        "sprung": (st.PulseServo(servo.replace({"gear.stiffness": 30.0, "gear.damping": 0.02,
                                                "gear.output_inertia": 1e-3})), pulses, dragging, True),
        "bounded": (st.BoundedServo(servo.replace(MEAN)), volts, dragging, True),
        "bounded pulses": (st.BoundedServo(servo.replace(MEAN)), pulses, st.loads.Spring(stiffness=0.1, rest_angle=0.3),
                           True),
        "averaged": (st.AveragedServo(servo.replace(MEAN)), pulses, swinging + dragging, False),
        "averaged inductive": (st.AveragedServoInductive(servo.replace({**MEAN, **INDUCTIVE})), volts, swinging, False),
        "motor": (st.DCMotor(servo.replace(INDUCTIVE)), wave, None, False),
    }


def signals_of(st, name, how):
    """Return all signals and the energy of a case, "plain/…" and "batch/…", and the laws that the former called."""
    if name == ON_A_BUS:
        return on_a_bus(st, *cases(st)["tiles that measure"][:3], how)
    model, command, load, batched = cases(st)[name]
    found, laws = called_laws(partial(plainly, st, name, model, command, load, batched))
    if batched and how != "plain":
        R = model.value("motor.armature_resistance")
        batch = st.simulate_many(model, command, duration=SECONDS, load=load, output_step=0.005,
                                 outputs=model.available,
                                 parameters={"motor.armature_resistance": [R, 1.01 * R, 1.02 * R]})
        sims = st.VectorSimulator(model, 2, load=load, threads=1)
        sims.reset(pulse_width=700e-6)
        for _ in range(TICKS):
            sims.advance(TICK, pulse_width=1200e-6)
        for signal in model.available:
            found[f"batch/{name}/{signal}"] = batch[signal][0]
            found[f"batch/{name}, ticks/{signal}"] = sims[signal][:1]
    return found, laws


def plainly(st, name, model, command, load, ticks):
    """Return all signals and the energy of a case, run as it stands, and all signals after some ticks."""
    plain = st.simulate(model, command, duration=SECONDS, load=load, output_step=0.005, seed=0)
    found = {f"plain/{name}/{signal}": plain[signal] for signal in model.available}
    found[f"plain/{name}/energy"] = np.array(astuple(plain.energy))
    if ticks:
        sim, command = st.Simulator(model, load), st.signals.constant(1200.0, unit="us")
        state = sim.initial(st.signals.constant(700.0, unit="us"))
        for k in range(TICKS):
            state = sim.advance(state, (k + 1) * TICK, command)
        found |= {f"plain/{name}, ticks/{signal}": np.array([sim.observe(state, signal, command)])
                  for signal in model.available}
    return found


def on_a_bus(st, model, command, load, how):
    """Return all signals of a servo alone on a stiff bus, as a batch of the plain one, and the laws of the latter.

    Behind a soft one a servo's circuit is a loop through the source, and that of several a balance of currents: a law
    of currents that is 1 % off makes two different things of these.
    """
    model = type(model)(model.servo.replace({"supply.internal_resistance": 0.0}))
    supply = st.Supply(open_circuit_voltage=model.value("supply.open_circuit_voltage"))
    plain, laws = called_laws(lambda: st.simulate(model, command, duration=SECONDS, load=load, output_step=0.005))
    found = {f"plain/{ON_A_BUS}/{signal}": plain[signal] for signal in model.available}
    if how != "plain":
        fleet = st.simulate_bus({"alone": (model, command, load)}, supply=supply, duration=SECONDS, output_step=0.005)
        found |= {f"batch/{ON_A_BUS}/{signal}": fleet["alone"][signal] for signal in model.available}
    return found, laws


def without_compiler():
    """Let batches run the derived text as it is, in the forms that compiled ones take."""
    from servotwin.simulation.compile import calls
    from servotwin.simulation.compile.backend import plain_module
    from servotwin.simulation.lanes import store, whole_runs

    kernels = cache(plain_module)
    for module in (whole_runs, store, calls):
        module.kernels = kernels
    calls.is_plain = lambda: True


def called_laws(run):
    """Return what `run` returns in plain Python, and the names of the functions of `physics` that it has called."""
    from servotwin.simulation.compile import backend

    names = set()

    def look(frame, event, _):
        code = frame.f_code
        if event == "call" and code.co_filename.startswith("<array form of servotwin.physics."):
            names.add(code.co_filename[:-1].rpartition(".")[2])
        elif event == "call" and "/physics/" in code.co_filename.replace("\\", "/"):
            names.add(code.co_name)

    backend._without_compiler.append(True)
    sys.setprofile(look)
    try:
        return run(), names
    finally:
        sys.setprofile(None)
        backend._without_compiler.pop()


def laws_compiled(names):
    """Return what laws give for random numbers, "plain/…" and "batch/…": as they are, and as kernels have them."""
    import inspect

    from servotwin import physics
    from servotwin.simulation.compile import Recipe, kernels

    laws = {name: inspect.unwrap(getattr(physics, name)) for name in names}
    compiled = kernels(Recipe("laws", tuple(f"{law.__module__}:{law.__name__}" for law in laws.values()), vector=True))
    rng, found = np.random.default_rng(5), {}
    for name, law in laws.items():
        kinds = {key: parameter.annotation for key, parameter in inspect.signature(law).parameters.items()}
        results = []
        while len(results) < POINTS:
            given = {key: bool(x > 0.0) if kinds[key] == "bool" else abs(float(x)) if key in POSITIVE else float(x)
                     for key, x in zip(kinds, rng.uniform(-3.0, 3.0, len(kinds)), strict=True)}
            try:
                plain = law(**given)
            except (ArithmeticError, ValueError):
                continue
            if not np.isnan(plain).any():  # else numbers for which the law says nothing
                results.append((plain, getattr(compiled, law.__name__)(**given)))
        found[f"plain/laws/{name}"], found[f"batch/laws/{name}"] = (
            np.array(each, dtype=np.float64) for each in zip(*results, strict=True))
    return found


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # np.float64 says when it divides by 0, which compiled code does not
    import servotwin

    out, how, *wanted = sys.argv[1:]
    if how == "derived":
        from servotwin.simulation.lanes import forms

        without_compiler()
        forms.unread = lambda recipe, of=(): ()  # laws change here, no numbers
    found, laws = {}, {}
    if how == "laws":
        found = laws_compiled(wanted)
    else:
        known = cases(servotwin)
        for name in wanted or [*(name for name, case in known.items() if how == "plain" or case[-1]), ON_A_BUS]:
            signals, names = signals_of(servotwin, name, how)
            found |= signals
            laws[name] = sorted(names)
    np.savez(out, **found)
    sys.stdout.write(json.dumps({"package": servotwin.__file__, "laws": laws}))
