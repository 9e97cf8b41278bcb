"""`identify_arm`: servos, supply, links, zeros and latency of a whole robot, from episodes of its joints."""

from __future__ import annotations

import contextlib
import math
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.identification.arms.arm_fit import HALF, ArmCause, ArmFit, Doubts, causes_of, confirmed, doubts_of
from servotwin.identification.arms.rows import (
    CLOCK,
    GAIN,
    LATENCY,
    LATENCY_SCALE,
    Episode,
    LeftOut,
    Linear,
    Noise,
    Numbers,
    beyond_scatter,
    episodes_from,
    motions_of,
    noise_of,
    parts_of,
    spread_of,
    strange_windows,
    used_rows,
    usual_steps,
    without,
)
from servotwin.identification.arms.search import Demand, Problem, WholeArm, link_names, links_of, with_masses
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.diagnosis.drifts import counts_turns
from servotwin.identification.fitting.registers import (
    PROMISING,
    TAKEN,
    Bench,
    Lanes,
    RegisterSearch,
    State,
    Tried,
    has_registers,
    numbers_apart,
)
from servotwin.identification.fitting.registers import searched as registers_searched
from servotwin.identification.fitting.search.case import DELAY_SCALE
from servotwin.identification.fitting.search.stopping import Stops, Within
from servotwin.models import Model, default_model
from servotwin.parameters import Servo, Supply, load_servo
from servotwin.parameters.registers.held import as_robot_has_it, said_of, set_of_robot
from servotwin.parameters.servo import OUTPUT_SIDE, Quantity
from servotwin.robots import Motion, Mount, RobotValidation, joint_names, robot_model, validate_robot
from servotwin.robots.motion import joints_of_dataset
from servotwin.robots.overlaps import leave_out_measured
from servotwin.robots.servos.coupling import couplings_of
from servotwin.units import is_finite

# --- The robot of a fit: its model, its servos, and what stands for them where nobody says ----------------------------

UNKNOWN = "unknown"
_SO101, _ARM_SERVO = "so101", "feetech-sts3215-12v"
_MASS, _REACH, _SPREAD = 0.2, 0.1, 1e-3  # kg, m, kg m²: of the pendulum that stands for an unknown arm


def plant_of(robot: Any, joints: Sequence[str]) -> tuple[Any, tuple[str, ...]]:
    """Return the MjModel of a robot, and what was assumed; "unknown" gives every joint a pendulum of its own."""
    from servotwin.robots.places import load_mujoco

    if robot != UNKNOWN:
        return robot_model(robot), ()
    root = Xml.Element("mujoco", model=UNKNOWN)
    Xml.SubElement(root, "option", timestep="0.002")
    Xml.SubElement(root, "compiler", angle="radian", inertiafromgeom="false")
    world = Xml.SubElement(root, "worldbody")
    for k, joint in enumerate(joints):
        body = Xml.SubElement(world, "body", name=f"{joint}_weight", pos=f"0 {k} 0")
        Xml.SubElement(body, "joint", name=joint, axis="0 1 0")
        Xml.SubElement(body, "inertial", pos=f"{_REACH} 0 0", mass=str(_MASS), diaginertia="1e-6 1e-6 1e-6")
        wheel = Xml.SubElement(body, "body", name=f"{joint}_inertia")
        Xml.SubElement(wheel, "inertial", pos="0 0 0", mass="1e-3", diaginertia=f"{_SPREAD} {_SPREAD} {_SPREAD}")
    spec = load_mujoco().MjSpec.from_string(Xml.tostring(root, encoding="unicode"))
    return robot_model(spec), (
        "no robot file: each joint is a bare servo with an unknown arm, a weight that hangs at an unknown angle and an "
        "inertia; what joints do to each other is not in it",)


def mounts_of(servos: Any, robot: Any, plant: Any, motions: Sequence[Motion]) -> tuple[dict[str, Mount],
                                                                                       tuple[str, ...]]:
    """Return the servos at the joints of a robot, and what was assumed of them.

    Raises
    ------
    InputError
        If there is no servo, or the joints do not match.
    """
    recorded = [joint for joint in motions[0].measured if all(joint in one.angles for one in motions)]
    joints = [name for name, kind in joint_names(plant).items() if kind == "angle" and name in recorded]
    if not joints:
        raise InputError(f"joints of {motions[0].source}", got=", ".join(motions[0].angles),
                         allowed=f"joints of the robot: {', '.join(joint_names(plant))}")
    kind = motions[0].robot
    if servos is None:
        if robot != _SO101:
            raise InputError("servo of a robot", got="none", allowed="a servo, or one of each joint by its name")
        servos, kind = load_servo(_ARM_SERVO), kind or _SO101
    given = dict(servos) if isinstance(servos, Mapping) else dict.fromkeys(joints, servos)
    for joint in given:
        if joint not in joint_names(plant):
            raise UnknownNameError("joint of the robot", joint, joint_names(plant))
    made, changed = {}, []
    for joint in joints:
        if joint not in given:
            continue
        mount = _mount(given[joint])
        servo = as_robot_has_it(mount.model.servo, kind, joint) if kind else mount.model.servo
        if servo is not mount.model.servo:
            changed.append(set_of_robot(kind, joint))
            mount = Mount(type(mount.model)(servo), mount.zero, mount.direction, mount.ratio)
        made[joint] = mount
    if not made:
        raise InputError("servos", got=", ".join(given), allowed=f"some at recorded joints: {', '.join(joints)}")
    kinds = {type(mount.model) for mount in made.values()}
    if len(kinds) > 1:
        raise InputError("servos of a robot", got=" and ".join(sorted(kind.__name__ for kind in kinds)),
                         allowed="models of one kind")
    free = [name for name in joint_names(plant) if name not in made and name not in couplings_of(plant)]
    return made, (*((said_of(kind, *changed),) if changed else ()), *((
        f"no servo and no recorded goals at {', '.join(free)}: what hangs there moves freely",) if free else ()))


def _mount(given: Any) -> Mount:
    if isinstance(given, Mount):
        return given
    model: Model = default_model(given) if isinstance(given, Servo) else given
    return Mount(model)


def supply_of(bus: Supply | None, mounts: Mapping[str, Mount]) -> Supply | None:
    """Return the supply that all servos share: the given one, or that of the first servo's file."""
    if bus is not None:
        return bus
    model = next(iter(mounts.values())).model
    volts = model.value_or("supply.open_circuit_voltage", 0.0)
    return Supply(open_circuit_voltage=volts, internal_resistance=model.value_or("supply.internal_resistance", 0.0)
                  or None) if volts > 0.0 else None


# --- Registers of a robot's servos that nobody recorded, tried as whole lanes of its joints before its fit ------------

Make = Callable[[Mapping[str, Mount]], Numbers]
_EPISODES, _REGISTERS_SECONDS = 2, 12.0  # that are looked at, those in which goals go furthest, and of each [s]
_MOVES = 0.05  # rad: a joint that moves less tells nothing


class _ArmBench(Bench):
    """Joints of a robot one by one, under the torque and inertia that their measured motion asks for.

    Masses, zeros and numbers of servos are those of files. Registers make up for some of what is wrong with these, so
    that no finer values are tried, and another register counts only where it leaves less than half.
    """

    rounds = 0

    def __init__(self, what: Problem, make: Make, episodes: Sequence[Episode]) -> None:
        super().__init__([mount.model.servo for mount in what.numbers.mounts.values()],
                         np.any([np.ptp(one.measured, axis=0) > _MOVES for one in episodes], axis=0))
        self.what, self.make, self.episodes = what, make, [*episodes]
        self.used = [used_rows(one)[:, 0] for one in self.episodes]

    def simplest(self, seen: Mapping[State, Tried]) -> list[State]:
        """Return the states with as few choices as do not leave twice what others do, of fewest registers first."""
        least = min(one.error for one in seen.values())
        few = min(state.choices for state, one in seen.items() if TAKEN * one.error <= least)
        some = {state: one for state, one in seen.items() if state.choices == few}
        least = min(one.error for one in some.values())
        near = [state for state, one in some.items() if one.error <= PROMISING * least]
        return sorted(near, key=lambda state: (len(seen[state].registers), seen[state].error))

    def lanes(self, some: Sequence[Tried]) -> Lanes:
        """Return what simulates servos of one form, in all episodes."""
        numbers = self.make(with_servos(self.what.numbers.mounts, some[0].servos))
        lanes, late = self.what._replace(numbers=numbers).lanes(), numbers.names.index(LATENCY)
        apart = [numbers_apart([one.servos[j] for one in some]) for j in range(len(self.servos))]

        def run(which: Sequence[int], delays: Array) -> list[tuple[Array, Array]]:
            points = np.repeat(numbers.start[None], len(which), axis=0)
            points[:, late] = delays / LATENCY_SCALE
            columns = numbers.columns(points)
            for j, (own, names) in enumerate(zip(columns, apart, strict=True)):
                own |= {name: np.array([some[k].servos[j].get(name) for k in which], np.float64) for name in names}
            residual, later = [], []
            for episode, used in zip(self.episodes, self.used, strict=True):
                angles = lanes.run(episode, points, columns)
                residual.append((angles - episode.measured)[:, used])
                later.append(-DELAY_SCALE * np.gradient(angles, episode.time, axis=1)[:, used])
            return [*zip(np.concatenate(residual, axis=1), np.concatenate(later, axis=1), strict=True)]

        return run


def with_servos(mounts: Mapping[str, Mount], servos: Sequence[Servo]) -> dict[str, Mount]:
    """Return mounts with other servos, in the order of the joints."""
    return {joint: Mount(type(mount.model)(servo), mount.zero, mount.direction, mount.ratio)
            for (joint, mount), servo in zip(mounts.items(), servos, strict=True)}


def arm_registers(what: Problem, make: Make) -> tuple[RegisterSearch | None, dict[str, Mount]]:
    """Return what stands in the registers of a robot's servos, and the mounts with those that are taken.

    All servos get the same registers, and single ones others where that clearly leaves less of their own error.

    Parameters
    ----------
    what : Problem
    make : callable
        Returns the numbers of a fit with other mounts.
    """
    mounts = dict(what.numbers.mounts)
    if not has_registers([mount.model for mount in mounts.values()]):
        return None, mounts
    episodes = sorted(what.episodes, key=lambda one: -float(np.abs(np.diff(one.goals, axis=0)).sum()))[:_EPISODES]
    some = what._replace(episodes=episodes).shorter(_REGISTERS_SECONDS).episodes
    bench = _ArmBench(what, make, some)
    search = registers_searched(bench, bench, names=[*mounts])
    if search is None:
        return None, mounts
    servos = search.taken.servos if search.taken is not None else [mount.model.servo for mount in mounts.values()]
    servos = [search.joints[joint].servo if joint in search.joints else servo
              for joint, servo in zip(mounts, servos, strict=True)]
    return search, with_servos(mounts, servos)


# --- The two stages of the fit of a robot, of which each keeps the best that it has found wherever it is stopped ------

Show = Callable[[float, str], None]
_ROUNDS, _STEPS = 2, 8  # of the first stage
_SECONDS = 20.0  # of each episode, that the search for causes looks at
_WHOLE_TURNS, _WHOLE_STEPS = 2, 6  # of the second: derivatives, and steps by them
_FAR = 1.0  # widths of a belief, over which derivatives change
_TRIED = 1.5  # widths of a belief, that make causes be tried
_NOISY = 2e-3  # rad at rest: more than counts and a clock leave
JOINTS_ALONE, CAUSES, WHOLE, INTERVALS = (
    "where the search of single joints ends", "what may be the matter", "what the whole robot does", "intervals")


@dataclass
class Way:
    """How far a fit has come.

    Parameters
    ----------
    what : Problem
    x : ndarray
        The best so far.
    noise : Noise
    steps : ndarray, optional
        For derivatives.
    found : bool
        Whether that is more than the start.
    left_out : tuple of LeftOut
    causes : tuple of ArmCause
    doubts : Doubts, optional
    missing : list of str
        Results that are not known yet.
    seconds : dict of str to float
        CPU time that each stage took.
    registers : RegisterSearch, optional
        Values of registers that nobody recorded.
    """

    what: Problem
    x: Array
    noise: Noise
    steps: Array | None = None
    found: bool = False
    left_out: tuple[LeftOut, ...] = ()
    causes: tuple[ArmCause, ...] = ()
    doubts: Doubts | None = None
    missing: list[str] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    registers: RegisterSearch | None = None

    def keep(self, other: Way, best: Array) -> None:
        """Take over what another one fits, with the best so far."""
        self.what, self.x, self.noise, self.steps, self.found = other.what, best, other.noise, other.steps, True
        self.left_out = other.left_out

    def know(self, what: str) -> None:
        """Note that something is no longer missing."""
        self.missing = [one for one in self.missing if one != what]

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Note the CPU time of a stage."""
        began = clock.process_time()
        try:
            yield
        finally:
            self.seconds[stage] = clock.process_time() - began


def searched(what: Problem, make: Callable[[Sequence[str], Mapping[str, Mount]], Numbers], course: Stops, *,
             intervals: bool, diagnose: bool) -> Way:
    """Return where a fit ends; a stop ends the stage that it meets, and those that come after it are left out."""
    way = Way(what, what.numbers.start.copy(), Noise(np.zeros(0), 0.0))
    way.missing = [JOINTS_ALONE, *([CAUSES] if diagnose else []), *([WHOLE, INTERVALS] if intervals else [])]
    try:
        with way.timed("registers"):
            course(0.0, "registers")
            way.registers, mounts = arm_registers(what, lambda having: make((), having))
            what = what._replace(numbers=make((), mounts))
        with way.timed("first"):
            _first_stage(way, what, course)
        if diagnose:
            with way.timed("causes"):
                _look_for_causes(way, lambda gains: make(gains, mounts), course)
        with way.timed("second"):
            _second_stage(way, course, intervals=intervals)
    except KeyboardInterrupt:
        pass
    return way


def _first_stage(way: Way, what: Problem, show: Show) -> None:
    """Search with lanes of single joints, and leave out what no numbers explain."""
    lanes, x, steps = what.lanes(), what.numbers.start.copy(), usual_steps(what.numbers)
    windows: tuple[LeftOut, ...] = ()
    for turn in range(_ROUNDS):
        noise = noise_of(what.episodes, what.left(lanes, x), what.used)
        now = Way(what, x, noise, left_out=windows)

        def tell(step: int, best: Array, now: Way = now, turn: int = turn) -> None:
            if turn or step:
                way.keep(now, best)
            show(0.4 * (turn + step / _STEPS) / _ROUNDS, "joints one by one")

        search = what.search(lanes, noise, steps=steps)
        x, steps = search.run(x, most=_STEPS, tell=tell), search.steps
        if turn == 0:
            left = what.left(lanes, x)
            noise = noise_of(what.episodes, left, what.used)
            windows = strange_windows(what.episodes, left, what.used, noise, what.numbers.joints)
            what = what._replace(used=without(what.used, what.episodes, windows, what.numbers.joints))
    way.keep(Way(what, x, noise_of(what.episodes, what.left(lanes, x), what.used), steps, left_out=windows), x)
    way.know(JOINTS_ALONE)


def _look_for_causes(way: Way, make: Callable[[Sequence[str]], Numbers], show: Show) -> None:
    """Seek causes where a belief is pushed far, or what is left is no noise; a wrong gain is searched from then on."""
    what, noise = way.what, way.noise
    off = np.abs(way.x - what.numbers.start) * what.numbers.weight
    if off.max() >= _TRIED or noise.positions.max() >= _NOISY:
        show(0.4, "causes")
        way.causes = causes_of(what.shorter(_SECONDS), noise, way.x, make)
    if way.causes and way.causes[0].joints:  # what the wrong gain has bent is found anew with that gain searched
        _first_stage(way, what._replace(numbers=make(way.causes[0].joints),
                                        used=[used_rows(one) for one in what.episodes]), show)


def _second_stage(way: Way, show: Show, *, intervals: bool) -> None:
    """Search with the whole robot, and see what its derivatives say of the numbers."""
    what = way.what
    arm = what.whole()
    way.x, way.noise = _nearest(what, arm, way.x)
    noise = way.noise
    if not intervals:
        way.know(CAUSES)
        return

    for turn in range(_WHOLE_TURNS):
        def tell(step: int, best: Array, turn: int = turn) -> None:
            way.x = best
            show(0.6 + 0.2 * turn + 0.05 * step / _WHOLE_STEPS, "the whole robot")

        show(0.45 + 0.2 * turn, "the whole robot")
        search, x = what.search(arm, noise, steps=way.steps), way.x
        steps, linear = search.steps, search.linear(x, central=True)
        slopes, shakes = _clean(what, linear, noise), [one.scatter * steps for one in linear]
        way.steps = search.steps
        way.x = search.along(x, slopes, most=_WHOLE_STEPS, tell=tell)
        far = float(np.abs((way.x - x) * np.where(what.numbers.weight > 0.0, what.numbers.weight, 1.0)).max())
        if far < _FAR:
            break
    way.know(WHOLE)
    way.causes = confirmed(way.causes, what, arm, noise, way.x, slopes)
    way.know(CAUSES)
    show(0.85, "intervals")
    found = what.left(arm, way.x)
    way.noise = noise_of(what.episodes, found, what.used)
    way.doubts = doubts_of(what, way.x, way.noise, found, slopes, shakes)
    way.know(INTERVALS)


def _nearest(what: Problem, arm: WholeArm, x: Array) -> tuple[Array, Noise]:
    """Return which of some points the whole robot moves nearest by, and the noise that it leaves.

    Joints that hang on others without servos, or that stick, do otherwise alone: what the search of single joints has
    found may then be worse than what the files say.
    """
    late = np.where(np.array(what.numbers.names) == LATENCY, x, what.numbers.start)
    points = (x, late, what.numbers.start)
    found = [what.left(arm, point) for point in points]
    best = int(np.argmin([spread_of(left, what.used) for left in found]))
    return points[best], noise_of(what.episodes, found[best], what.used)


def _clean(what: Problem, linear: Sequence[Linear], noise: Noise) -> list[Array]:
    """Return derivatives without directions in which they are no more than their noise."""
    tables = [[np.concatenate([part.shared for part in parts_of(episode, one.residual, some, noise, used)])
               for episode, one, used, some in zip(what.episodes, linear, what.used, chosen, strict=True)]
              for chosen in ([one.slopes for one in linear], [one.scatter for one in linear])]
    kept = beyond_scatter(*(np.concatenate(one) for one in tables))
    return [one.slopes @ kept for one in linear]


# --- `identify_arm` ---------------------------------------------------------------------------------------------------

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
        Parameters of servos that are searched.
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
    """Return a line on each belief that the episodes push far and determine better."""
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
