"""`identify_arm`: servos, supply, links, zeros and latency of a whole robot, from episodes of its joints."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.arms.arm_fit import HALF, ArmFit
from servotwin.identification.arms.dynamics import Demand, link_names, links_of, with_masses
from servotwin.identification.arms.episodes import episodes_from, motions_of
from servotwin.identification.arms.numbers import CLOCK, GAIN, Numbers
from servotwin.identification.arms.plant import UNKNOWN, mounts_of, plant_of, supply_of
from servotwin.identification.arms.problem import Problem
from servotwin.identification.arms.rows import used_rows
from servotwin.identification.arms.stages import Way, searched
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.diagnosis.counted import counts_turns
from servotwin.identification.fitting.stopping import Stops, Within
from servotwin.parameters import Servo, Supply
from servotwin.parameters.output_side import OUTPUT_SIDE
from servotwin.parameters.quantity import Quantity
from servotwin.robots import Motion, Mount, RobotValidation, validate_robot
from servotwin.robots.contacts import leave_out_measured
from servotwin.robots.episode import joints_of_dataset
from servotwin.units import is_finite

Array = NDArray[np.float64]
_HELD_OUT = 4  # episodes for each that is held out
_MOST_SHARE = 3.0  # of masses: beyond, a bound of three times that is none
_PUSHED = 2.5  # widths of a belief, that are said
_SURELY = 3.0  # standard deviations


def identify_arm(logs: Any, robot: Any, servos: Any = None, *, bus: Supply | None = None, each: bool = False,
                 masses: float = 0.1, zeros: bool = True, free: Sequence[str] | None = None,
                 holdout: int | None = None, level: float = 0.95, intervals: bool = True, diagnose: bool = True,
                 within: float | Within | None = None, progress: Any = False) -> ArmFit:
    """Fit the servos of a robot, their supply, the masses of its links, the zeros of its joints and the loop's latency.

    Registers of bus servos that nobody recorded are tried first, all servos alike and single ones; those that leave
    less than half of the error are fitted from, and a warning says so. In a first stage every joint is a lane,
    under the torque and inertia that the measured motion of all joints asks of it; a second one drives the whole
    robot, with copies in which one number is moved, and gives errors and intervals.

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
    within, progress
        As of `identify`.

    Returns
    -------
    ArmFit
        After a stop (Ctrl-C, a KeyboardInterrupt out of `progress`, or the end of `within`) the best so far; its
        `unknown` says what is not known then.

    Raises
    ------
    KeyboardInterrupt
        If it is stopped before the first step.
    InputError
        On bad input: no servo, joints that do not match, nothing measured; a time in which nothing is found.
    """
    limit, masses = Within(within), _checked_share(masses)
    named = joints_of_dataset(Path(logs)) if robot == UNKNOWN and isinstance(logs, str | Path) else ()
    first = motions_of(logs, plant_of(robot, named)[0])
    plant, said = plant_of(robot, tuple(first[0].measured))
    said += leave_out_measured(plant, first)
    mounts, assumed = mounts_of(servos, robot, plant, first)
    supply = supply_of(bus, mounts)
    joints = list(mounts)
    links = links_of(plant, joints)
    episodes = episodes_from(first, joints, mounts)
    counted = counts_turns([one.time for one in episodes])

    def make(gains: Sequence[str] = (), having: Mapping[str, Mount] | None = None) -> Numbers:
        return Numbers(having or mounts, link_names(plant, links), supply, each=each, free=free, zeros=zeros,
                       gains=gains, masses=max(masses, 2.0) if robot == UNKNOWN else masses, counted=counted)

    level, course = checks.checked_level(level), Stops(limit)
    count = _held_out(len(episodes), holdout)
    fitted, unseen = ([one.motion for one in some] for some in (
        episodes[:len(episodes) - count], episodes[len(episodes) - count:]))
    what = Problem(plant, make(), links, episodes[:len(fitted)], [used_rows(one) for one in episodes[:len(fitted)]],
                   course.look, Demand(plant, joints, links))
    with course.watching(), checks.shown(progress) as show:
        course.show = show
        way = searched(what, make, course, intervals=intervals, diagnose=diagnose)
        _check_found(way, limit)
        with contextlib.suppress(KeyboardInterrupt):
            course(0.9, "errors")
        with way.timed("errors"):
            tables = _tables(way.what, way.x, mounts, fitted, unseen)
    found = () if way.registers is None else way.registers.sentences
    warnings = (*_stopped(way), *found, *said, *assumed, *_pushed(way), *(() if count else (
        "one episode: nothing was held out, so nothing says how well another one is predicted",)))
    return _fit(way, warnings=warnings, tables=tables, level=level)


def _checked_share(masses: float) -> float:
    if not (is_finite(masses) and 0.0 <= masses <= _MOST_SHARE):
        raise InputError("masses", got=masses, allowed=f"a share from 0 to {_MOST_SHARE:g}")
    return float(masses)


def _check_found(way: Way, limit: Within) -> None:
    """Raise if a stop came before anything was found."""
    if not way.found and limit.over:
        raise InputError("within", got="a time in which nothing was found", allowed="a longer one")
    if not way.found:
        raise KeyboardInterrupt


def _stopped(way: Way) -> tuple[str, ...]:
    return (f"stopped: the best so far; not known are {', '.join(way.missing)}",) if way.missing else ()


def _held_out(count: int, asked: int | None) -> int:
    if asked is None:
        return 0 if count < 2 else max(count // _HELD_OUT, 1)
    if isinstance(asked, bool) or not isinstance(asked, int) or not 0 <= asked < count:
        raise InputError("holdout", got=asked, allowed=f"a number of episodes, 0 to {count - 1}")
    return asked


def _pushed(way: Way) -> list[str]:
    """Return a line on each belief that the episodes push far and know better."""
    what, x, doubts, found = way.what, way.x, way.doubts, []
    for k, one in enumerate(what.numbers.all):
        if one.name == CLOCK:
            found += _late(one.value(float(x[k])), one.value(float(doubts.all.std[k])) if doubts else math.inf)
            continue
        widths = (x[k] - one.start) / one.belief if math.isfinite(one.belief) else 0.0
        if abs(widths) > _PUSHED and (doubts is None or doubts.shares[one.name] < HALF):
            found.append(f"{one.name} was pushed {abs(widths):.1f} widths of its belief, from "
                         f"{one.value(one.start):.4g} to {one.value(float(x[k])):.4g} {one.unit}: the file may be of "
                         "another servo or robot")
    return found


def _late(share: float, std: float) -> list[str]:
    """Return a line on turns of the loop that take longer than stamps say, where that is sure."""
    return [f"turns of the loop take {100 * share:.2g} % longer than the stamps say, which only count them: have the "
            "recorder stamp each row when it is measured"] if share > _SURELY * std else []


Tables = tuple[RobotValidation, RobotValidation, RobotValidation | None, RobotValidation | None]


def _tables(what: Problem, x: Array, mounts: Mapping[str, Mount], fitted: Sequence[Motion],
            unseen: Sequence[Motion]) -> Tables:
    """Return errors on fitted and unseen episodes, after the fit and before, with servos as they were given."""
    numbers, found = what.numbers, list[RobotValidation | None]()
    after = with_masses(what.plant, what.links, numbers.masses(x))
    zeros, turn = dict(zip(numbers.joints, numbers.zeros(x).tolist(), strict=True)), numbers.turn(x)
    for motions in (fitted, unseen):
        if not motions:
            found += [None, None]
            continue
        plain = [replace(one, robot="") for one in motions]
        moved = [replace(one, time=turn * one.time, angles={name: one.angles[name] + zeros[name] for name in zeros},
                         measured={name: one.measured[name] + zeros[name] for name in zeros}) for one in plain]
        found.append(validate_robot(after, numbers.mounts_at(x), moved, bus=numbers.supply(x), rivals=(),
                                    latency=numbers.latency(x), joint_friction="keep", assume_heat=False))
        found.append(validate_robot(what.plant, mounts, plain, bus=numbers.bus, rivals=(),
                                    joint_friction="keep", assume_heat=False))
    if found[0] is None or found[1] is None:
        raise InputError("logs of a robot", got="none that is fitted", allowed="at least one episode")
    return found[0], found[1], found[2], found[3]


def _fit(way: Way, *, warnings: tuple[str, ...], tables: Tables, level: float) -> ArmFit:
    what, x, doubts, noise = way.what, way.x, way.doubts, way.noise
    numbers = what.numbers
    estimates = {one.name: one.value(float(x[k])) for k, one in enumerate(numbers.all)}
    fit = ArmFit(
        model=with_masses(what.plant, what.links, numbers.masses(x)), servos={}, supply=numbers.supply(x),
        masses=dict(zip(numbers.links, numbers.masses(x).tolist(), strict=True)),
        zeros=dict(zip(numbers.joints, numbers.zeros(x).tolist(), strict=True)), latency=numbers.latency(x),
        names=numbers.names, estimates=estimates, units={one.name: one.unit for one in numbers.all},
        unidentifiable=doubts.unidentifiable if doubts else (),
        at_bound=tuple(np.array(numbers.names)[what.at_bound(x)].tolist()), training=tables[0], before=tables[1],
        holdout=tables[2], before_holdout=tables[3],
        noise={**dict(zip(numbers.joints, noise.positions.tolist(), strict=True)), "clock": noise.stamps},
        left_out=way.left_out, causes=way.causes, warnings=warnings, numbers=numbers, best=x,
        doubt=doubts.all if doubts else None, prior_share=doubts.shares if doubts else {}, stages=way.seconds,
        registers=way.registers, level=level, interrupted=bool(way.missing), unknown=tuple(way.missing))
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
