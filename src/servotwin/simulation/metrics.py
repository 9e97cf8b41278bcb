"""Metrics of a step response, read from the continuous solution and not from samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin import physics
from servotwin.errors import InputError
from servotwin.look import number, table
from servotwin.models import BoundedServo, DigitalServo, PulseServo, PulseServoInductive
from servotwin.models.engine.memory import FLAT
from servotwin.models.engine.observe import stored_energy
from servotwin.models.outputs import electrical_of, motor_speed_of, torques_of, warm_plant
from servotwin.models.state.modes import Vector
from servotwin.physics.electronics import control_voltage_from_pulse
from servotwin.physics.potentiometer import angle_from_voltage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.loads import Load
    from servotwin.models import Model
    from servotwin.models.columns import Samples
    from servotwin.models.terms.numbers import Numbers
    from servotwin.physics._typing import Real
    from servotwin.physics.pieces import Pieces
    from servotwin.simulation.result import Result
    from servotwin.simulation.trajectory import Trajectory


# --- When a shaft has arrived where a step sends it -------------------------------------------------------------------

_SHARE = 0.05  # of the step
_STEPS = 2.0  # deadbands or counts, whichever is wider
_NEAR = math.radians(1.0)  # a degree, as far as the step is long enough


def resolution(model: Model) -> Any:
    """Return within which angle a servo does not tell two apart: its deadband, of full width, or its count [rad].

    Of a model whose numbers are columns of lanes it is one.
    """
    if isinstance(model, DigitalServo):
        firmware = model.firmware()
        return np.maximum(firmware.quantum, 2.0 * firmware.h)
    p = model.value_or("potentiometer.feedback_gain", 0.0)
    if isinstance(model, BoundedServo):
        return angle_from_voltage(model.value_or("electronics.voltage_deadband", 0.0), p)
    if isinstance(model, PulseServo | PulseServoInductive):
        width = model.value_or("electronics.deadband", 0.0)
        return angle_from_voltage(control_voltage_from_pulse(width, model.value("electronics.one_shot_slope")), p)
    return 0.0


def tolerance(way: Real, finest: Real) -> Real:
    """Return how far from its target [rad] a shaft may end that has arrived.

    Parameters
    ----------
    way : float or array
        From where it stood to the target [rad].
    finest : float or array
        `resolution` of the servo [rad].

    Returns
    -------
    float or array
        5 % of the way, or two deadbands or counts where those are more.

    Examples
    --------
    >>> float(tolerance(-1.0, 0.001)), float(tolerance(0.01, 0.001))
    (0.05, 0.002)
    """
    return np.maximum(_SHARE * np.abs(way), _STEPS * finest)


def arrival_band(way: float, finest: float) -> float:
    """Return how near its target [rad] a shaft counts as being there: within 1°, or the tolerance of a small step.

    It is never more than half of the way. Parameters are those of `tolerance`.

    Examples
    --------
    >>> [round(math.degrees(arrival_band(math.radians(way), 0.0)), 3) for way in (90.0, 20.0, 3.0)]
    [1.0, 1.0, 0.15]
    """
    return float(min(_NEAR, tolerance(way, finest), 0.5 * abs(way)))


# --- Metrics of a step response, read from the continuous solution and not from samples -------------------------------
_LOOK = 0.1  # s, five usual frames
_UNITS = {"rise_time": "s", "settling_time": "s", "arrival_time": "s", "overshoot": "", "slew_rate": "rad/s",
          "peak_current": "A"}


@dataclass(frozen=True)
class StepMetrics:
    """Metrics of a step response; times count from the step.

    A shaft that ends farther from its target than 5 % of its way, and than two deadbands or counts, has not arrived:
    it has neither rise time nor settling time nor overshoot. One that does not come to rest has no settling time.

    Parameters
    ----------
    initial, final, target : float
        Angle at the step, at the end of the run, and commanded [rad]; the target is nan for motors.
    rise_time : float
        From 10 % to 90 % of the way from initial to final; nan where there is none [s].
    settling_time : float
        Until the angle stays within 2 % of the way around the final angle; nan where it does not [s].
    overshoot : float
        Beyond the final angle, as a fraction of the way; nan where there is none.
    steady_error : float
        Target − final [rad].
    slew_rate : float
        Highest speed [rad/s].
    peak_current : float
        Highest magnitude of the armature current [A].
    arrival_time : float
        Until the angle stays within `arrival_band` of the target; nan where it does not by the end [s].
    arrival_band : float
        1°, or less of a small step: 5 % of the way, or two deadbands or counts, but at most half of the way [rad].
    """

    initial: float
    final: float
    target: float
    rise_time: float
    settling_time: float
    overshoot: float
    steady_error: float
    slew_rate: float
    peak_current: float
    arrival_time: float = math.nan
    arrival_band: float = math.nan

    def _repr_html_(self) -> str:
        """Return all of them with their units (SI), as notebooks show them."""
        return table(["metric", "value", "unit"], [
            [f"<code>{name}</code>", number(value), _UNITS.get(name, "rad")] for name, value in asdict(self).items()])


def step_metrics(result: Result) -> StepMetrics:
    """Return the metrics of a result whose command steps once."""
    result.raise_if_failed()
    table = result.command.pieces.table
    changes = [p for p in table[1:] if p.start >= 0.0]
    if len(changes) != 1 or any(p.slope or p.amplitude for p in table):
        raise InputError("step metrics", got="a command that is not a single step", allowed="one made by signals.step")
    start = changes[0].start
    if start >= result.ended:
        raise InputError("step metrics", got=f"a step at {start:g} s in a run of {result.ended:g} s",
                         allowed="a step within the run")
    angle_name = result.model.layout[0]
    q0, q1 = result.at(angle_name, [start, result.ended]).tolist()
    way = q1 - q0
    has_target = "command_angle" in result.model.available
    target = float(result.at("command_angle", [result.ended])[0]) if has_target else math.nan

    def progress(samples: Samples) -> NDArray[np.float64]:
        return np.asarray((samples.angle - q0) / way)

    nan = math.nan
    rise = settling = overshoot = nan
    finest = float(resolution(result.model))
    arrived = not has_target or abs(target - q1) <= tolerance(target - q0, finest)
    if abs(way) > 1e-12 and arrived:
        t10, t90 = (_first_reach(result.trajectory, progress, start, level) for level in (0.1, 0.9))
        rise = t90 - t10
        rest = result.rest
        if rest is None or rest.swing == 0.0:
            settling = _last_outside(result.trajectory, progress, start, 0.02) - start
        overshoot = max(0.0, _highest(result.trajectory, progress, start)[1] - 1.0)
        overshoot = 0.0 if overshoot < 1e-12 else overshoot
    band = arrival_band(target - q0, finest) if has_target else nan
    return StepMetrics(
        initial=q0, final=q1, target=target, rise_time=rise, settling_time=settling, overshoot=overshoot,
        steady_error=target - q1, slew_rate=result.peak(result.model.layout[1]),
        peak_current=result.peak("armature_current"), arrival_time=_arrival(result, target, q1, start, band),
        arrival_band=band)


def _arrival(result: Result, target: float, final: float, start: float, band: float) -> float:
    """Return the time [s] from the step on until the angle stays near the target; nan where it ends elsewhere."""
    if not abs(final - target) <= band:
        return math.nan
    return _last_outside(result.trajectory, lambda samples: 1.0 + np.asarray(samples.angle - target), start,
                         band) - start


def holding_error(result: Result) -> float:
    """Return the mean of command less angle while the command stands still at the end [rad].

    The mean is that of the last tenth of a second, or of as much as there is since the command stands still; nan where
    it never does, or the model has no angle of its command.
    """
    last = result.command.pieces.table[-1]
    start = max(result.ended - _LOOK, last.start, 0.0)
    if "command_angle" not in result.model.available or last.slope or last.amplitude or not start < result.ended:
        return math.nan
    asked = float(result.at("command_angle", [result.ended])[0])
    return asked - result.mean(result.model.layout[0], start)


def mean_current(result: Result, since: float = 0.0) -> float:
    """Return the mean current of the supply from `since` [s] on [A].

    Of a model without a supply it is that of the motor regardless of its sign.
    """
    name = "supply_current" if "supply_current" in result.model.available else "armature_current"
    if name == "supply_current":
        return result.mean(name, since)
    whole = result.trajectory.since(since).integral(
        lambda samples: np.abs(result.model.output(name, samples, result.drive, result.load))[None, :])
    return float(whole[0]) / (result.ended - since)


def peak(trajectory: Trajectory, signal: Callable[[Samples], NDArray[np.float64]]) -> float:
    """Return the largest magnitude of a signal over a whole run."""
    return _highest(trajectory, lambda samples: np.abs(signal(samples)), -math.inf)[1]


class Least(NamedTuple):
    """The least value of a signal, and when it came first [s]."""

    value: float
    time: float


def least(trajectory: Trajectory, signal: Callable[[Samples], NDArray[np.float64]]) -> Least:
    """Return the least value of a signal over a whole run; where it lies flat, when that begins.

    Within 1e-6 of it, V of a voltage, a signal counts as there.
    """
    def fallen(samples: Samples) -> NDArray[np.float64]:
        return -signal(samples)

    times, values = _dense(trajectory, fallen, -math.inf)
    when, best = _top(trajectory, fallen, times, values)
    level = best - FLAT
    k = next((k for k, own in enumerate(values) if (own >= level).any()), None)
    if k is None:  # it lies between samples, or there are none
        return Least(-best, when)
    n = int(np.argmax(values[k] >= level))
    return Least(-best, float(times[k][n]) if n == 0 else _bisected(
        trajectory, k, lambda samples: fallen(samples) - level, float(times[k][n - 1]), float(times[k][n])))


def _values(trajectory: Trajectory, index: int, signal: Callable[[Samples], NDArray[np.float64]],
            start: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    times = trajectory.dense_times(index)
    times = times[times >= start]
    return times, signal(trajectory.inside(index, times))


def _highest(trajectory: Trajectory, signal: Callable[[Samples], NDArray[np.float64]],
             start: float) -> tuple[float, float]:
    """Return time and value of the highest point from `start` on."""
    return _top(trajectory, signal, *_dense(trajectory, signal, start))


def _dense(trajectory: Trajectory, signal: Callable[[Samples], NDArray[np.float64]],
           start: float) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Return times from `start` on that resolve each segment, and a signal there."""
    looked_at = [trajectory.dense_times(k) for k in range(len(trajectory.segments))]
    looked_at = [times[times >= start] for times in looked_at]
    if not looked_at:
        return [], []
    ends = np.cumsum([times.size for times in looked_at])[:-1]
    return looked_at, np.split(signal(trajectory.inside_each(looked_at)), ends)


def _top(trajectory: Trajectory, signal: Callable[[Samples], NDArray[np.float64]],
         looked_at: Sequence[NDArray[np.float64]], of_each: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """Return time and value of the highest point, from what a signal is at dense times of each segment."""
    when, best, found = math.nan, -math.inf, []
    for k, (times, values) in enumerate(zip(looked_at, of_each, strict=True)):
        if values.size == 0:
            continue
        n = int(values.argmax())
        around = slice(max(n - 1, 0), n + 2)
        found.append((float(values[n]), k, times[around], values[around]))
        if values[n] > best:
            when, best = float(times[n]), float(values[n])
    # Where two segments meet both have the same highest sample, and the top is in either of them.
    close = best - 1e-9 * abs(best)
    for highest, k, times, values in found:
        if highest >= close and values.min() < highest:
            time, value = _refined(trajectory, k, signal, float(times[0]), float(times[-1]))
            if value > best:
                when, best = time, value
    return when, best


def _refined(trajectory: Trajectory, index: int, signal: Callable[[Samples], NDArray[np.float64]], a: float,
             b: float) -> tuple[float, float]:
    """Return time and value of the only top between a and b [s], on grids that close in on it."""
    when, best = a, -math.inf
    for _ in range(20):
        times = np.linspace(a, b, 9)
        values = signal(trajectory.inside(index, times))
        n = int(values.argmax())
        if values[n] > best:
            when, best = float(times[n]), float(values[n])
        a, b = float(times[max(n - 1, 0)]), float(times[min(n + 1, 8)])
        if b - a <= 1e-9 * max(abs(b), 1e-6):
            break
    return when, best


def _first_reach(trajectory: Trajectory, signal: Callable[[Samples], NDArray[np.float64]], start: float,
                 level: float) -> float:
    for k in range(len(trajectory.segments)):
        times, values = _values(trajectory, k, signal, start)
        reached = np.flatnonzero(values >= level)
        if reached.size:
            n = int(reached[0])
            return float(times[n]) if n == 0 else _bisected(
                trajectory, k, lambda s: signal(s) - level, float(times[n - 1]), float(times[n]))
    return math.nan


def _last_outside(trajectory: Trajectory, signal: Callable[[Samples], NDArray[np.float64]], start: float,
                  band: float) -> float:
    def outside(samples: Samples) -> NDArray[np.float64]:
        return np.abs(signal(samples) - 1.0) - band

    for k in reversed(range(len(trajectory.segments))):
        times, values = _values(trajectory, k, outside, start)
        late = np.flatnonzero(values > 0.0)
        if late.size:
            n = int(late[-1])
            return float(times[n]) if n == times.size - 1 else _bisected(
                trajectory, k, outside, float(times[n]), float(times[n + 1]))
    return start


def _bisected(trajectory: Trajectory, index: int, signal: Callable[[Samples], NDArray[np.float64]], a: float,
              b: float) -> float:
    def at(t: float) -> float:
        return float(signal(trajectory.inside(index, np.array([t])))[0])

    rising = at(b) > 0.0
    for _ in range(80):
        middle = 0.5 * (a + b)
        if b - a <= 1e-15 * max(abs(b), 1.0):
            break
        a, b = (a, middle) if (at(middle) > 0.0) == rising else (middle, b)
    return 0.5 * (a + b)


# --- Where the energy went: an integral of every power over the continuous solution -----------------------------------
@dataclass(frozen=True)
class Energy:
    """Energy balance of a run [J]; supply = winding + bridge + brush + friction + stops + load + stored + residual.

    Parameters
    ----------
    supply : float
        Delivered by the supply: ∫ V_bus i dt of a pulse servo's bus, ∫ v_a i_a dt at the motor's terminals for models
        with a mean voltage; negative when the motor feeds back.
    winding : float
        Heat in the armature resistance.
    bridge, brush : float
        Heat in the bridge and at the brushes; zero for models with a mean armature voltage.
    conversion : float
        Mechanical power that k_a ≠ k_b makes of electrical power; zero for an ideal motor.
    friction : float
        Heat in motor and gear, viscous and dry, and in the damper of an elastic gear.
    stops : float
        Lost in impacts, on the end stops and at the ends of the gear's play.
    load : float
        Given to the load: its damping, dry friction and external torque (its inertia counts as stored, and so does a
        spring between shaft and load).
    stored : float
        Increase of kinetic and magnetic energy, and of that in a spring between two bodies.
    residual : float
        Remainder of the balance; rounding and quadrature.
    """

    supply: float
    winding: float
    bridge: float
    brush: float
    conversion: float
    friction: float
    stops: float
    load: float
    stored: float
    residual: float


def energy_of(model: Model, trajectory: Trajectory, drive: Pieces, load: Load) -> Energy:
    """Return the energy balance of a whole run."""
    def powers(samples: Samples) -> NDArray[np.float64]:
        plant = warm_plant(model, samples, load)
        circuit = electrical_of(plant, samples, drive)
        i, w_m = circuit.armature_current, motor_speed_of(plant, samples)
        torques = torques_of(model, samples, drive, load)
        converted = physics.back_emf(w_m, plant.motor.K_b) * i - torques.motor * w_m
        return np.array(np.broadcast_arrays(
            circuit.supply_power, physics.copper_loss(i, plant.motor.R), circuit.bridge_power, circuit.brush_power,
            converted, torques.gear_loss, torques.load_power))

    supply, winding, bridge, brush, conversion, friction, to_load = trajectory.integral(powers).tolist()
    stored, stops = _kinetic(model.plant(load), trajectory)
    return Energy(supply, winding, bridge, brush, conversion, friction, stops, to_load, stored,
                  supply - winding - bridge - brush - conversion - friction - stops - to_load - stored)


def _kinetic(plant: Numbers, trajectory: Trajectory) -> tuple[float, float]:
    """Return the energy stored over the run, and what impacts took."""
    own = trajectory.segments
    if not len(own):
        return 0.0, 0.0

    def stored(index: Any, ages: Any, ends: bool) -> list[float]:
        states = own.shown(np.asarray(index), np.asarray(ages), ends=ends)[:7].T.tolist()
        return [stored_energy(plant, Vector(*y)) for y in states]

    lengths = own.ends - own.anchors
    met = np.flatnonzero(own.anchors[1:] == own.starts[1:])
    lost = sum((before - after for before, after in zip(
        stored(met, lengths[met], True), stored(met + 1, np.zeros(len(met)), False), strict=True)), 0.0)
    last, first = stored([len(own) - 1, 0], [lengths[-1], own.starts[0] - own.anchors[0]], False)
    return last - first, lost
