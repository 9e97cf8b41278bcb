"""Fleets of bus servos on one supply: what they are and do, and how the package and the reference run them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

import servotwin as st
from leg_cases import SERVOS, values_of
from reference import digital_bus
from reference.drivetrain_circuit import Source
from servotwin.robots.servos.mount import with_heat

EVERY = 0.02  # s
LEAD = 3.7e-4  # s: the first call of lanes, so that no call ends at a tick
SEEN = ("output_angle", "motor_angle", "output_speed", "armature_current", "bus_voltage")
FREE = {"firmware.speed_limit": None, "firmware.acceleration_limit": None}
"""Goals are not approached by a profile: duties are large, and so are currents."""
CARRYING = (0.3, -0.3, 0.0, 0.05, -0.02)  # N m


class Fleet(NamedTuple):
    """Servos (names of `SERVOS`) with numbers that differ from theirs; arrays have a column for each servo."""

    names: tuple[str, ...]
    changes: tuple[dict[str, Any], ...]
    supply: st.Supply
    goals: np.ndarray  # (k, n), new every 20 ms
    torques: np.ndarray  # (k, n) likewise, or (1, n)
    inertias: np.ndarray
    angles: np.ndarray
    phases: np.ndarray
    duration: float
    hot: bool = False
    off: tuple[tuple[tuple[float, float], ...], ...] = ()  # of each servo, stretches (start, end) without torque

    @property
    def count(self) -> int:
        return len(self.names)


class Seen(NamedTuple):
    """Signals of all servos, (times, n); the motor's angle at its own shaft."""

    time: np.ndarray
    output_angle: np.ndarray
    motor_angle: np.ndarray
    output_speed: np.ndarray
    armature_current: np.ndarray
    bus_voltage: np.ndarray


def fleet(seed: int, n: int, R_b: float, *, limit: float | None = None, names: tuple[str, ...] = ("12 V",),
          changes: dict[str, Any] | None = None, unlike: bool = True, still: bool = False, duration: float = 0.2,
          **more: Any) -> Fleet:
    """Draw what servos do; `still`: goals and torques stay, `unlike`: ticks come at times of their own."""
    rng = np.random.default_rng(seed)
    count = 1 if still else round(duration / EVERY)
    return Fleet(
        names=tuple(names[k % len(names)] for k in range(n)), changes=(changes or {},) * n,
        supply=st.Supply(open_circuit_voltage=12.0, internal_resistance=R_b, current_limit=limit),
        goals=rng.uniform(-1.0, 1.0, (count, n)), torques=rng.choice(CARRYING, (1 if still else count, n)),
        inertias=rng.uniform(1e-3, 8e-3, n), angles=rng.uniform(-0.3, 0.3, n),
        phases=rng.uniform(2e-5, 9.8e-4, n) if unlike else np.zeros(n), duration=duration, **more)


def twins(n: int, goal: float, torque: float, R_b: float, duration: float = 0.1) -> Fleet:
    """Return servos that are told and carry the same: whatever happens to one happens to all at that instant."""
    one = fleet(0, n, R_b, changes=FREE, unlike=False, still=True, duration=duration)
    return one._replace(goals=np.full((1, n), goal), torques=np.full((1, n), torque), inertias=np.full(n, 2e-3),
                        angles=np.zeros(n))


def order(one: Fleet, which: list[int]) -> Fleet:
    """Return a fleet of some of the servos, in another order."""
    columns = {name: getattr(one, name)[:, which] for name in ("goals", "torques")}
    rows = {name: getattr(one, name)[which] for name in ("inertias", "angles", "phases")}
    off = tuple(one.off[k] for k in which) if one.off else ()
    return one._replace(names=tuple(one.names[k] for k in which), changes=tuple(one.changes[k] for k in which),
                        off=off, **columns, **rows)


def models(one: Fleet) -> list[st.DigitalServo]:
    """Return the models of all, with ticks at their own times."""
    made = [st.DigitalServo(SERVOS[name].replace({**changes, "firmware.control_phase": float(phase)}))
            for name, changes, phase in zip(one.names, one.changes, one.phases, strict=True)]
    return [with_heat(model) for model in made] if one.hot else made


def reductions(one: Fleet) -> np.ndarray:
    """Return the gears' reductions of all."""
    return np.array([SERVOS[name].gear.gear_reduction for name in one.names])


def reference(one: Fleet, times: np.ndarray) -> tuple[digital_bus.Traces, Seen]:
    """Solve them all as one system."""
    def pieces(rows: np.ndarray, k: int) -> list[tuple[float, float]]:
        return [(EVERY * j, float(x)) for j, x in enumerate(rows[:, k])]

    ones = [digital_bus.One(values_of(model.servo), pieces(one.goals, k), float(one.inertias[k]),
                            pieces(one.torques, k), float(one.angles[k]), one.off[k] if one.off else ())
            for k, model in enumerate(models(one))]
    limit = one.supply.current_limit
    source = Source(one.supply.open_circuit_voltage, one.supply.internal_resistance or 0.0,
                    *(() if limit is None else (limit,)))
    traces = digital_bus.run(ones, source, one.duration, times)
    q, x, w, i = (np.array([getattr(trace, name) for trace in traces.servos]).T
                  for name in ("output_angle", "motor_angle", "output_speed", "current"))
    return traces, Seen(times, q, x * reductions(one), w, i, np.repeat(traces.bus_voltage[:, None], one.count, 1))


def lanes(one: Fleet, call: float, *, lead: float = LEAD, alone: tuple[int, ...] = ()) -> Seen:
    """Go on in calls of a length, with another one of `LEAD` wherever goals change; what is seen after each.

    A `lead` of 0 lets calls end where ticks are. Servos in `alone` are not on the bus.
    """
    made, n = models(one), one.count
    on = [k for k in range(n) if k not in alone]
    bus = [(one.supply, on)] if on else None
    sims = st.VectorSimulator(made[0], n, bus=bus, load=st.loads.Inertia(1e-3), parameters=numbers(one), threads=1,
                              accuracy=1e-12)
    sims.reset(command_angle=one.goals[0], output_angle=one.angles)
    rows, times = [], []
    for start, end in zip(*cuts(one, call, lead), strict=True):
        k = min(int((start + 1e-9) / EVERY), len(one.goals) - 1)
        if one.off:
            sims.set(torque_enable=[not any(a <= start + 1e-9 < b for a, b in off) for off in one.off])
        sims.advance(end - start, command_angle=one.goals[k], external_torque=one.torques[min(k, len(one.torques) - 1)])
        rows.append([sims[name].copy() for name in SEEN])
        times.append(end)
    assert not sims.failures
    return Seen(np.array(times), *np.swapaxes(np.array(rows), 0, 1))


def cuts(one: Fleet, call: float, lead: float) -> tuple[list[float], list[float]]:
    """Return when calls begin and end."""
    marks = [j * call + shift for j in range(round(one.duration / call)) for shift in ((0.0, lead) if lead else (0.0,))]
    return marks, [*marks[1:], one.duration]


def numbers(one: Fleet) -> dict[str, np.ndarray]:
    """Return what differs from lane to lane."""
    servos = [model.servo for model in models(one)]
    names = {name for changes in one.changes for name in changes}
    unlike = {name: [servo.get(name) for servo in servos] for name in names}
    lanes = {name: np.array(values) for name, values in unlike.items() if len(set(values)) > 1}
    return {"firmware.control_phase": one.phases, "load.inertia": one.inertias, **lanes}


def together(one: Fleet, times: np.ndarray) -> tuple[st.Fleet, Seen]:
    """Run them by `simulate_bus`; their torques have to stay as they are."""
    at = EVERY * np.arange(len(one.goals))
    servos = {}
    for k, model in enumerate(models(one)):
        goals = (st.signals.constant(float(one.goals[0, k]), unit="rad") if len(at) == 1 else
                 st.signals.samples(at, one.goals[:, k], unit="rad", hold="previous"))
        load = st.loads.Inertia(float(one.inertias[k])) + st.loads.Constant(float(one.torques[0, k]))
        servos[str(k)] = (model, goals, load)
    found = st.simulate_bus(servos, supply=one.supply, duration=one.duration, output_times=times,
                            initial={str(k): {"output_angle": float(x)} for k, x in enumerate(one.angles)})
    found.raise_if_failed()
    columns = [np.array([result[name] for result in found.values()]).T for name in SEEN]
    return found, Seen(times, *columns)


def holding(one: Fleet) -> Fleet:
    """Return it with torques that stay."""
    return one._replace(torques=one.torques[:1])


def slower(one: Fleet, R_b: float) -> Fleet:
    """Return it on another resistance."""
    return one._replace(supply=replace(one.supply, internal_resistance=R_b))
