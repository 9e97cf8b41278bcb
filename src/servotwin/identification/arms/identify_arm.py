"""`identify_arm`: servos, supply, links, zeros and latency of a whole robot, from episodes of its joints."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.arms.arm_fit import HALF, ArmFit
from servotwin.identification.arms.causes import causes_of
from servotwin.identification.arms.dynamics import link_names, links_of, with_masses
from servotwin.identification.arms.episodes import Episode, episodes_from, motions_of
from servotwin.identification.arms.lanes import JointLanes
from servotwin.identification.arms.numbers import GAIN, RESISTANCE, VOLTAGE, Numbers
from servotwin.identification.arms.plant import UNKNOWN, mounts_of, plant_of, supply_of
from servotwin.identification.arms.rows import (
    Linear,
    Mask,
    Noise,
    beyond_scatter,
    noise_of,
    parts_of,
    residuals,
    used_rows,
)
from servotwin.identification.arms.search import ArmSearch
from servotwin.identification.arms.whole import WholeArm
from servotwin.identification.arms.windows import LeftOut, strange_windows, without
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.arrow import Loss, Prior
from servotwin.identification.fitting.task import HUBER
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty, rows_of, uncertainty
from servotwin.identification.fitting.words import Unidentifiable, explain, simplest, vague_directions
from servotwin.parameters import Servo, Supply
from servotwin.parameters.output_side import OUTPUT_SIDE
from servotwin.parameters.quantity import Quantity
from servotwin.robots import Motion, RobotValidation, validate_robot
from servotwin.robots.episode import joints_of_dataset

Array = NDArray[np.float64]
_ROUNDS, _STEPS = 2, 8  # of the first stage
_WHOLE_TURNS, _WHOLE_STEPS = 2, 6  # of the second: derivatives, and steps by them
_FAR = 1.0  # widths of a belief, over which derivatives change
_HELD_OUT = 4  # episodes for each that is held out
_PUSHED, _TRIED = 2.5, 1.5  # widths of a belief, that are said and that make causes be tried
_NOISY = 2e-3  # rad at rest: more than counts and a clock leave


class Whole(NamedTuple):
    """What is fitted: robot, numbers, links, episodes and their samples."""

    plant: Any
    numbers: Numbers
    links: list[int]
    episodes: list[Episode]
    used: list[Mask]

    def prior(self) -> Prior:
        """Return the beliefs."""
        return Prior(self.numbers.start, self.numbers.weight)

    def search(self, simulated: Any, noise: Noise, held: Mask) -> ArmSearch:
        """Return the least-squares problem of a stage."""
        return ArmSearch(simulated, self.episodes, self.used, noise, Loss(HUBER), self.prior(), held)


def identify_arm(logs: Any, robot: Any, servos: Any = None, *, bus: Supply | None = None, each: bool = False,
                 masses: float = 0.1, zeros: bool = True, free: Sequence[str] | None = None,
                 holdout: int | None = None, level: float = 0.95, intervals: bool = True, diagnose: bool = True,
                 progress: Any = False) -> ArmFit:
    """Fit the servos of a robot, their supply, the masses of its links, the zeros of its joints and the loop's latency.

    In a first stage every joint is a lane, under the torque and inertia that the measured motion of all joints asks of
    it; a second one drives the whole robot, with copies in which one number is moved, and gives errors and intervals.

    Parameters
    ----------
    logs : path, sequence of Motion or sequence of Log
        Episodes: a LeRobot dataset or a table of several joints, motions with measured positions, or the logs of such.
    robot : MjModel, MjSpec, str or Path
        Of an MJCF file; "so101"; or "unknown": every joint a bare servo with a weight and an inertia.
    servos : Servo, Model, Mount or mapping, optional
        Of all recorded joints, or by joint. Those of an "so101" are STS3215 unless given. An SO-100 or SO-101 has
        LeRobot's registers where its servos have the factory's; a warning says so.
    bus : Supply, optional
        That all share; the one of the first servo's file unless given.
    each : bool
        Fit every servo by itself; else one for all that are equal.
    masses : float
        How far the masses of the file may be off, as a share (standard deviation); 0: they are right.
    zeros : bool
        Whether joints may have their zeros elsewhere than the robot's file.
    free : sequence of str, optional
        What is searched of servos.
    holdout : int, optional
        How many episodes, the last ones, are not fitted but predicted; a fourth of them unless given, at least one of
        two.
    level : float
        Of intervals.
    intervals : bool
        False leaves the second stage's derivatives and the intervals out.
    diagnose : bool
        Whether causes are sought where noise does not explain what is left.
    progress : bool or callable
        As of `identify`.

    Returns
    -------
    ArmFit

    Raises
    ------
    InputError
        On bad input: no servo, joints that do not match, nothing measured.
    """
    began = clock.process_time()
    named = joints_of_dataset(Path(logs)) if robot == UNKNOWN and isinstance(logs, str | Path) else ()
    first = motions_of(logs, plant_of(robot, named)[0])
    plant, said = plant_of(robot, tuple(first[0].measured))
    mounts, assumed = mounts_of(servos, robot, plant, first)
    supply = supply_of(bus, mounts)
    joints = list(mounts)
    links = links_of(plant, joints)

    def make(gains: Sequence[str] = ()) -> Numbers:
        return Numbers(mounts, link_names(plant, links), supply, each=each, free=free, zeros=zeros, gains=gains,
                       masses=max(masses, 2.0) if robot == UNKNOWN else masses)

    numbers = make()
    episodes = episodes_from(first, joints, mounts)
    count = _held_out(len(episodes), holdout)
    fitted = episodes[:len(episodes) - count]
    what = Whole(plant, numbers, links, fitted, [used_rows(one) for one in fitted])
    level = checks.checked_level(level)
    with checks.shown(progress) as show:
        x, noise, what, windows = _first_stage(what, show)
        stages = {"first": clock.process_time() - began}
        causes = _causes(what, noise, x, make) if diagnose else ()
        if causes and causes[0].joints:  # what the wrong gain has bent is found anew with that gain searched
            what = what._replace(numbers=make(causes[0].joints), used=[used_rows(one) for one in fitted])
            x, noise, what, windows = _first_stage(what, show)
        stages["causes"] = clock.process_time() - began - sum(stages.values())
        x, noise, doubts = _second_stage(what, x, noise, show, intervals=intervals)
        stages["second"] = clock.process_time() - began - sum(stages.values())
        show(0.9, "errors")
        tables = _tables(what, x, [one.motion for one in fitted], [one.motion for one in episodes[len(fitted):]])
        stages["errors"] = clock.process_time() - began - sum(stages.values())
    warnings = (*said, *assumed, *_pushed(what, x, doubts), *(() if count else (
        "one episode: nothing was held out, so nothing says how well another one is predicted",)))
    return _fit(what, x, noise, doubts, windows=windows, causes=causes, warnings=warnings, tables=tables,
                stages=stages, level=level)


def _held_out(count: int, asked: int | None) -> int:
    if asked is None:
        return 0 if count < 2 else max(count // _HELD_OUT, 1)
    if isinstance(asked, bool) or not isinstance(asked, int) or not 0 <= asked < count:
        raise InputError("holdout", got=asked, allowed=f"a number of episodes, 0 to {count - 1}")
    return asked


def _first_stage(what: Whole, show: Any) -> tuple[Array, Noise, Whole, tuple[LeftOut, ...]]:
    """Return where lanes of single joints end, their noise, and what is left out."""
    lanes, held = JointLanes(what.plant, what.numbers, what.links), np.zeros(len(what.numbers), np.bool_)
    x = what.numbers.start.copy()
    windows: tuple[LeftOut, ...] = ()
    for turn in range(_ROUNDS):
        noise = noise_of(what.episodes, _left(lanes, what, x), what.used)
        x = what.search(lanes, noise, held).run(x, most=_STEPS, tell=lambda step, turn=turn: show(  # type: ignore[misc]
            0.4 * (turn + step / _STEPS) / _ROUNDS, "joints one by one"))
        if turn == 0:
            left = _left(lanes, what, x)
            noise = noise_of(what.episodes, left, what.used)
            windows = strange_windows(what.episodes, left, what.used, noise, what.numbers.joints)
            what = what._replace(used=without(what.used, what.episodes, windows, what.numbers.joints))
    return x, noise_of(what.episodes, _left(lanes, what, x), what.used), what, windows


def _left(simulated: Any, what: Whole, x: Array) -> list[Array]:
    return [residuals(simulated, episode, x[None])[0] for episode in what.episodes]


def _causes(what: Whole, noise: Noise, x: Array, make: Any) -> Any:
    """Return causes where a belief is pushed far, or what is left is no noise."""
    off = np.abs(x - what.numbers.start) * what.numbers.weight
    if off.max() < _TRIED and noise.positions.max() < _NOISY:
        return ()
    return causes_of(what.plant, what.numbers, what.links, what.episodes, what.used, noise, x, make)


class _Doubts(NamedTuple):
    all: Uncertainty
    shares: dict[str, float]
    unidentifiable: tuple[Unidentifiable, ...]


def _second_stage(what: Whole, x: Array, noise: Noise, show: Any, *, intervals: bool) -> tuple[Array, Noise,
                                                                                            _Doubts | None]:
    """Return where the whole robot ends, and what its derivatives say of the numbers."""
    arm, held = WholeArm(what.plant, what.numbers, what.links), np.zeros(len(what.numbers), np.bool_)
    noise = noise_of(what.episodes, _left(arm, what, x), what.used)
    if not intervals:
        return x, noise, None
    for turn in range(_WHOLE_TURNS):
        show(0.45 + 0.2 * turn, "the whole robot")
        search = what.search(arm, noise, held)
        slopes = _clean(what, search.linear(x, central=True), noise)
        moved = search.along(x, slopes, most=_WHOLE_STEPS)
        far = float(np.abs((moved - x) * np.where(what.numbers.weight > 0.0, what.numbers.weight, 1.0)).max())
        x = moved
        if far < _FAR:
            break
    show(0.85, "intervals")
    found = _left(arm, what, x)
    noise = noise_of(what.episodes, found, what.used)
    return x, noise, _doubts(what, x, noise, found, slopes)


def _clean(what: Whole, linear: Sequence[Linear], noise: Noise) -> list[Array]:
    """Return derivatives without directions in which they are no more than their noise."""
    tables = [[np.concatenate([part.shared for part in parts_of(episode, one.residual, some, noise, used)])
               for episode, one, used, some in zip(what.episodes, linear, what.used, chosen, strict=True)]
              for chosen in ([one.slopes for one in linear], [one.scatter for one in linear])]
    kept = beyond_scatter(*(np.concatenate(one) for one in tables))
    return [one.slopes @ kept for one in linear]


def _doubts(what: Whole, x: Array, noise: Noise, found: Sequence[Array], slopes: Sequence[Array]) -> _Doubts:
    numbers, loss, nothing = what.numbers, Loss(HUBER), Prior(np.zeros(0), np.zeros(0))
    rows: list[Rows] = [rows_of(part, loss, nothing, np.zeros(0)) for episode, residual, slope, used in zip(
        what.episodes, found, slopes, what.used, strict=True)
        for part in parts_of(episode, residual, slope, noise, used)]
    stuck = _at_bound(what, x)
    prior = what.prior()
    beliefs = uncertainty(rows, prior, stuck)
    known = np.array([numbers.weight[k] if name in (VOLTAGE, RESISTANCE) else 0.0
                      for k, name in enumerate(numbers.names)])
    moves = ~stuck
    information = (beliefs.information + np.diag(known**2))[np.ix_(moves, moves)]
    flags, directions = np.zeros(len(x), np.bool_), np.zeros((len(x), 0))
    flags[moves], some = vague_directions(information, beliefs.inflation, _sizes(what)[moves])
    directions = np.zeros((len(x), some.shape[1]))
    directions[moves] = some
    if some.shape[1]:
        directions = simplest(directions)
    belief = np.array([one.belief for one in numbers.all])
    prior_share = dict(zip(numbers.names, np.clip((beliefs.std / belief)**2, 0.0, 1.0).tolist(), strict=True))
    shares = [1.0 if one.logarithmic else math.nan for one in numbers.all]
    named = {str(one): one for one in explain(numbers.names, shares, flags, directions)}  # several of the same members
    return _Doubts(beliefs, prior_share, tuple(named.values()))


def _sizes(what: Whole) -> Array:
    """Return what counts as the whole of a number, on its scale: what is believed of it, or 1."""
    weight = what.numbers.weight
    return np.where(weight > 0.0, 1.0 / np.maximum(weight, 1e-300), 1.0)


def _at_bound(what: Whole, x: Array) -> Mask:
    return np.asarray((x <= what.numbers.lower + 1e-9) | (x >= what.numbers.upper - 1e-9))


def _pushed(what: Whole, x: Array, doubts: _Doubts | None) -> list[str]:
    """Return a line on each belief that the episodes push far and know better."""
    found = []
    for k, one in enumerate(what.numbers.all):
        widths = (x[k] - one.start) / one.belief if math.isfinite(one.belief) else 0.0
        if abs(widths) > _PUSHED and (doubts is None or doubts.shares[one.name] < HALF):
            found.append(f"{one.name} was pushed {abs(widths):.1f} widths of its belief, from "
                         f"{one.value(one.start):.4g} to {one.value(float(x[k])):.4g} {one.unit}: the file may be of "
                         "another servo or robot")
    return found


Tables = tuple[RobotValidation, RobotValidation, RobotValidation | None, RobotValidation | None]


def _tables(what: Whole, x: Array, fitted: Sequence[Motion], unseen: Sequence[Motion]) -> Tables:
    """Return errors on fitted and unseen episodes, after the fit and before."""
    numbers, found = what.numbers, list[RobotValidation | None]()
    after = with_masses(what.plant, what.links, numbers.masses(x))
    zeros = dict(zip(numbers.joints, numbers.zeros(x).tolist(), strict=True))
    for motions in (fitted, unseen):
        if not motions:
            found += [None, None]
            continue
        plain = [replace(one, robot="") for one in motions]
        moved = [replace(one, angles={name: one.angles[name] + zeros[name] for name in zeros}, measured={
            name: one.measured[name] + zeros[name] for name in zeros}) for one in plain]
        found.append(validate_robot(after, numbers.mounts_at(x), moved, bus=numbers.supply(x), rivals=(),
                                    latency=numbers.latency(x), joint_friction="keep", assume_heat=False))
        found.append(validate_robot(what.plant, numbers.mounts, plain, bus=numbers.bus, rivals=(),
                                    joint_friction="keep", assume_heat=False))
    if found[0] is None or found[1] is None:
        raise InputError("logs of a robot", got="none that is fitted", allowed="at least one episode")
    return found[0], found[1], found[2], found[3]


def _fit(what: Whole, x: Array, noise: Noise, doubts: _Doubts | None, *, windows: tuple[LeftOut, ...], causes: Any,
         warnings: tuple[str, ...], tables: Tables, stages: dict[str, float], level: float) -> ArmFit:
    numbers = what.numbers
    estimates = {one.name: one.value(float(x[k])) for k, one in enumerate(numbers.all)}
    fit = ArmFit(
        model=with_masses(what.plant, what.links, numbers.masses(x)), servos={}, supply=numbers.supply(x),
        masses=dict(zip(numbers.links, numbers.masses(x).tolist(), strict=True)),
        zeros=dict(zip(numbers.joints, numbers.zeros(x).tolist(), strict=True)), latency=numbers.latency(x),
        names=numbers.names, estimates=estimates, units={one.name: one.unit for one in numbers.all},
        unidentifiable=doubts.unidentifiable if doubts else (),
        at_bound=tuple(np.array(numbers.names)[_at_bound(what, x)].tolist()), training=tables[0], before=tables[1],
        holdout=tables[2], before_holdout=tables[3],
        noise={**dict(zip(numbers.joints, noise.positions.tolist(), strict=True)), "clock": noise.stamps},
        left_out=windows, causes=causes, warnings=warnings, numbers=numbers, best=x,
        doubt=doubts.all if doubts else None, prior_share=doubts.shares if doubts else {}, stages=stages, level=level)
    return replace(fit, servos=_servos(fit))


def _servos(fit: ArmFit) -> dict[str, Servo]:
    """Return the servos with what was found as identified, its interval as range."""
    found, spreads = {}, fit.intervals()
    for k, joint in enumerate(fit.numbers.joints):
        group = next(one for one in fit.numbers.groups if k in one.joints)
        servo = fit.numbers.servo(fit.best, k)
        quantities = dict(servo.quantities)
        for name in group.space.names:
            full = name if name in fit.estimates else f"{group.name}: {name}"
            lower, upper, method = spreads[full]
            members, power = (OUTPUT_SIDE[name].members, OUTPUT_SIDE[name].power) if name in OUTPUT_SIDE else (
                (name,), 0)
            factor = float(servo.get("gear.gear_reduction") or 1.0) ** power  # type: ignore[arg-type]
            for member in members:
                value = float(servo.get(member))  # type: ignore[arg-type]
                ends = {} if math.isnan(lower) else {"lower": min(lower / factor, value),
                                                     "upper": max(upper / factor, value)}
                quantities[member] = Quantity(value=value, unit=servo.quantities[member].unit, origin="identified",
                                              source=f"fit to episodes of a robot; as {name}, {method}", **ends)
        if f"gain.{joint}" in spreads:
            lower, upper, method = spreads[f"gain.{joint}"]
            said, value = servo.quantities[GAIN], float(servo.get(GAIN))  # type: ignore[arg-type]
            ends = {} if math.isnan(lower) else {"lower": value * lower / fit.estimates[f"gain.{joint}"],
                                                 "upper": value * upper / fit.estimates[f"gain.{joint}"]}
            quantities[GAIN] = Quantity(value=value, unit=said.unit, origin="identified", source=(
                f"fit to episodes of a robot: {fit.estimates[f'gain.{joint}']:.3g} times what its register says, "
                f"{method}"), **ends)
        found[joint] = replace(servo, quantities=quantities)
    return found
