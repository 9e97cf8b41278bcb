"""Sets of servos that stop and go on: lanes tick by tick, from Python and from C, on a shared supply, in MuJoCo."""

from collections.abc import Callable
from typing import Any

import numpy as np

import servotwin as st
from servotwin.simulation import bus_run
from servotwin.simulation.compile.layout import SHOWN

LANES, TURNS = 8, 60
SAVED, RESTORED, CHANGED, LIMP = 24, 42, 15, (30, 36)  # turns at which something is done
SEEN_EVERY = 6  # turns
Found = dict[str, np.ndarray]


def told(rng: np.random.Generator, kind: type, lanes: int) -> dict[str, Any]:
    """Return the command of a tick, of one kind or another."""
    if kind is st.DigitalServo:
        return {"command_angle": rng.uniform(-0.8, 1.0, lanes)}
    if kind in (st.BoundedServo, st.AveragedServo) or rng.random() < 0.5:
        return {"command_angle": rng.uniform(0.4, 1.6, lanes)}
    return {"pulse_width": rng.uniform(1.1e-3, 1.9e-3, lanes)}


def imposed(rng: np.random.Generator, on_bus: bool) -> dict[str, Any]:
    """Return what another simulator imposes at a tick: each thing now and then."""
    found = {"output_angle": rng.uniform(0.5, 0.9, LANES), "output_speed": rng.uniform(-3.0, 3.0, LANES),
             "load_inertia": rng.uniform(5e-4, 4e-3, LANES), "bus_voltage": rng.choice([5.0, 5.7, 7.0], LANES)}
    if on_bus:
        del found["bus_voltage"]
    return {name: values for name, values in found.items() if rng.random() < 0.12}


def prepared(model_of: Callable[..., Any], changes: dict[str, Any], kind: type, load: Any, spread: Callable[..., Any],
             nudge: float, seed: int, **options: Any) -> tuple[Any, np.random.Generator]:
    """Return a simulator of lanes at rest, and what draws its ticks."""
    rng, digital = np.random.default_rng(seed), kind is st.DigitalServo
    numbers = spread(rng, LANES, digital, nudge)
    if kind in (st.BoundedServo, st.AveragedServo):
        del numbers["electronics.stretcher_gain"]
    sims = st.VectorSimulator(model_of(changes, kind, nudge), LANES, load=load, parameters=numbers, seed=3,
                              **{"threads": 1} | options)
    sims.reset(**told(rng, kind, LANES), output_angle=rng.uniform(0.5, 0.9, LANES))
    return sims, rng


def ticked(model_of: Callable[..., Any], changes: dict[str, Any], kind: type, load: Any, spread: Callable[..., Any],
           seed: int = 7, **options: Any) -> Callable[..., Found]:
    """Return what runs a `VectorSimulator` by ticks of random lengths, with all that may happen between them."""
    def run(nudge: float = 1.0, **how: Any) -> Found:
        sims, rng = prepared(model_of, changes, kind, load, spread, nudge, seed, **options, **how)
        looks: dict[str, list[np.ndarray]] = {name: [] for name in sims.signals}
        memory = None
        for turn in range(TURNS):
            between(sims, rng, kind, turn, "bus" in options, nudge)
            if turn == SAVED:
                memory = sims.save()
            if turn == RESTORED:
                sims.restore(memory)
            given = told(rng, kind, LANES) if rng.random() < 0.5 else {}
            if rng.random() < 0.4:
                given["external_torque"] = rng.uniform(-0.1, 0.1, LANES)
            sims.advance(float(rng.choice([1e-3, 2.5e-3, 7e-3, 0.021])), **given)
            if turn % SEEN_EVERY == 0:
                for name, rows in looks.items():
                    rows.append(sims[name])
        found = {name: np.array(rows).T for name, rows in looks.items()}
        return found | {"status": sims.status, "time": sims.time, "impulse_work": sims.impulse_work}
    return run


def between(sims: Any, rng: np.random.Generator, kind: type, turn: int, on_bus: bool, nudge: float) -> None:
    """Do what is done between two ticks."""
    sims.set(**imposed(rng, on_bus))
    if turn == CHANGED:
        sims.set(parameters={"motor.armature_resistance": 3.3 * nudge}, lanes=[1, 4])
        sims.reset(**told(rng, kind, 1), lanes=[6])
    if kind is st.DigitalServo and turn in LIMP:
        sims.set(torque_enable=turn == LIMP[1], lanes=[0, 2])


def by_c(model_of: Callable[..., Any], changes: dict[str, Any], kind: type, load: Any, spread: Callable[..., Any],
         seed: int = 9, **options: Any) -> Callable[..., Found]:
    """Return what runs a `VectorSimulator` by the entry for C, which imposes and shows as well."""
    def run(nudge: float = 1.0, **how: Any) -> Found:
        sims, rng = prepared(model_of, changes, kind, load, spread, nudge, seed, **options, **how)
        entry, rows = sims.c_entry(), []
        for _ in range(TURNS):
            given = told(rng, kind, LANES) if rng.random() < 0.5 else {}
            if rng.random() < 0.4:
                given["external_torque"] = rng.uniform(-0.1, 0.1, LANES)
            given |= {f"set_{name}": values for name, values in imposed(rng, "bus" in options).items()}
            shown = {name: np.empty(LANES) for name in SHOWN}
            entry.advance(entry.tick(float(rng.choice([1e-3, 2.5e-3, 7e-3, 0.021])), **given, **shown,
                                     status=np.empty(LANES, np.int8)))
            rows.append(shown)
        return {name: np.array([row[name] for row in rows]).T for name in SHOWN} | {"status": sims.status}
    return run


def on_bus(model_of: Callable[..., Any], changes: dict[str, Any], kind: type, load: Any, supply: Any,
           servos: int = 5, duration: float = 0.4, seed: int = 5) -> Callable[..., Found]:
    """Return what runs some servos on one supply by `simulate_bus`, compiled: signals, events and the bus."""
    def run(nudge: float = 1.0) -> Found:
        rng, digital = np.random.default_rng(seed), kind is st.DigitalServo
        sets = {}
        for k in range(servos):
            at = np.concatenate(([0.0], np.sort(rng.uniform(0.0, 0.8 * duration, 2))))
            command = (st.signals.samples(at, rng.uniform(-0.8, 1.0, 3), unit="rad") if digital
                       else st.signals.samples(at, rng.uniform(1.0e-3, 2.0e-3, 3), unit="s"))
            body = load + st.loads.Inertia(rng.uniform(5e-4, 4e-3)) + st.loads.Constant(rng.uniform(-0.1, 0.1))
            sets[str(k)] = (model_of(changes, kind, nudge), command, body)
        times = np.sort(rng.uniform(0.0, duration, 40))
        before, bus_run.COMPILES_FROM = bus_run.COMPILES_FROM, 0.0
        try:
            fleet = st.simulate_bus(sets, supply=supply, duration=duration, seed=2**65 + 7, output_times=times)
        finally:
            bus_run.COMPILES_FROM = before
        found = {name: np.array([one[name] for one in fleet.values()]) for name in fleet["0"].names if name != "time"}
        return found | {
            "bus": fleet.bus_voltage, "status": np.array([one.status.code for one in fleet.values()]),
            "event times": np.array([event.time for one in fleet.values() for event in one.events]),
            "events": np.array([sum(map(ord, event.kind)) for one in fleet.values() for event in one.events])}
    return run


CHAIN = """<mujoco><option timestep="1e-3" integrator="implicitfast"><flag contact="disable"/></option><worldbody>
  <body><joint name="j0" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".03"/>
  <body pos=".1 0 0"><joint name="j1" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".03"/>
  <body pos=".1 0 0"><joint name="j2" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".03"/>
  </body></body></body></worldbody></mujoco>"""


def in_mujoco(model_of: Callable[..., Any], servos: dict[str, tuple[dict[str, Any], type]],
              steps: int = 400) -> Callable[..., Found]:
    """Return what runs servos at the joints of a chain in MuJoCo."""
    def run(nudge: float = 1.0) -> Found:
        import mujoco
        drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(CHAIN), {
            joint: model_of(changes, kind, nudge) for joint, (changes, kind) in servos.items()}, assume_heat=False)
        data, rng, rows = mujoco.MjData(drive.model), np.random.default_rng(2), []
        for k in range(steps):
            if k % 80 == 0:
                drive.command(data, dict(zip(servos, rng.uniform(0.2, 0.9, len(servos)), strict=True)))
            drive.step(data)
            if k % 20 == 19:
                rows.append((data.qpos.copy(), data.qvel.copy(), data.qfrc_applied.copy()))
        return dict(zip(("angle", "speed", "torque"), map(np.array, zip(*rows, strict=True)), strict=True))
    return run
