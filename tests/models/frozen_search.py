"""Which draws `frozen_servos.py` keeps: those whose results rounding alone does not move.

A draw is run again with parameters changed by one rounding, in pieces, and with changes of 1e-11, which show how much
it amplifies and whether an event barely happens. Output times are chosen where little moves, away from events. What is
kept moves by `CALM`; where that is rare for the features of a case, by `RESTLESS`. A motion that is integrated in steps
may move by far more, as rounding decides its steps: where no draw is calm, one is kept that is `LOOSE`, and each of its
signals is allowed a multiple of what it moves.
"""

import collections
import time
import warnings

import numpy as np

import servotwin as st
from models.frozen_servos import (
    BUSES,
    FILE,
    MOST_ON_BUS,
    SERVO,
    SIGNALS,
    STOPS,
    TIMES,
    bus_features,
    bus_of,
    case,
    case_of,
    described,
    is_batched,
    moves,
    plan,
    run,
    run_bus,
    run_lanes,
)

CALM = 2e-14, 3e-9  # moves by rounding, and by a change of 1e-11
RESTLESS = 2e-13, 3e-8
LOOSE = 1e-7, 1e-5
LIMITS = (*[CALM] * 10, *[RESTLESS] * 6, *[LOOSE] * 24)  # of each draw
EFFECT_DRAWS = 20  # in which the feature of a case has to show
TOLERANCE, MARGIN = 1e-12, 50.0  # what a test allows, and how many times the moves of a loose case
ULP, LARGER = 2.0**-52, 1e-11
SINGLE = 2e-6, 6e-6  # rad: moves of float32 by its rounding, and its distance from float64
AWAY = 1e-6  # s, of output times from all that jumps
CANDIDATES = 30  # output times to choose from

NEAR = 1.2e-7  # a rounding of float32
ANGLE = SIGNALS.index("output_angle")

PROBED = ("motor.torque_constant", "motor.armature_resistance", "motor.rotor_inertia", "electronics.one_shot_slope",
          "motor.back_emf_constant", "potentiometer.feedback_gain", "supply.open_circuit_voltage",
          "gear.gear_reduction", "friction.coulomb_torque_forward")
ROUNDINGS = 10  # probes by one rounding of some parameters; then some by more


def _probes():
    """Return factors of the probed parameters, one row for each probe."""
    signs = np.random.default_rng(6).integers(-1, 2, (ROUNDINGS, len(PROBED)))
    signs[-4:] = np.eye(4, len(PROBED))
    larger = np.zeros((2, len(PROBED)))
    larger[:, :4] = [[1, 0, 0, -1], [-1, 0, 1, 1]]
    return np.vstack([1.0 + ULP * signs, 1.0 + LARGER * larger])


PROBES = _probes()


class Unfit(Exception):  # noqa: N818 - not an error: the next draw is tried
    """Why a draw is not kept."""


def _values(servo, factors):
    return {name: float(servo.get(name) * factor) for name, factor in zip(PROBED, factors, strict=True)}


def _candidates(starts, duration, number, draw):
    """Return times [s] away from all `starts` of motions."""
    times = np.sort(np.random.default_rng([4, number, draw]).uniform(0.02, 0.999, CANDIDATES)) * duration
    starts = np.append(starts, duration)
    return times[np.min(np.abs(times[:, None] - starts), axis=1) > AWAY]


def _pieces(one, times):
    """Return the states (names, times) of a case that is advanced in pieces, with cuts at odd times too."""
    simulator = st.Simulator(one.model, one.load, one.seed)
    state = simulator.initial(one.command, one.initial)
    cuts = np.unique(np.concatenate([times, one.duration * np.array([0.0137, 0.271, 0.4999, 0.77]), [one.duration]]))
    rows = []
    for cut in cuts:
        state = simulator.advance(state, float(cut), one.command)
        if cut in times or cut == one.duration:
            rows.append(state.values)
    return state.names, np.array(rows).T


class _Moved:
    """How far the signals of one form moved (18, times), and angle and speed at the end: by rounding, and by more."""

    def __init__(self, before, times):
        self.before = before
        self.rounding, self.more = np.zeros((len(SIGNALS), len(times))), np.zeros((len(SIGNALS), len(times)))
        self.last, self.last_more = np.zeros(2), np.zeros(2)

    def add(self, other, k):
        """Take in what the probe k moves."""
        into, into_last = (self.rounding, self.last) if k < ROUNDINGS else (self.more, self.last_more)
        np.maximum(into, moves(self.before.signals, other.signals), out=into)
        np.maximum(into_last, moves(self.before.last[:, None], other.last[:, None])[:, 0], out=into_last)

    def within(self, limits):
        """Tell at which times all moves are within the limits."""
        calm = (self.rounding.max(axis=0) <= limits[0]) & (self.more.max(axis=0) <= limits[1])
        return calm & (self.last.max() <= limits[0]) & (self.last_more.max() <= limits[1])

    def check(self, limits):
        """Raise Unfit if too few times are left."""
        if self.within(limits).sum() < TIMES:
            by_rounding = (self.rounding.max(axis=0) <= limits[0]).sum() < TIMES or self.last.max() > limits[0]
            raise Unfit("moves by rounding" if by_rounding else "amplifies")

    def allowed(self, chosen, limits):
        """Return what a test allows of each signal, and of angle and speed at the end."""
        if limits is not LOOSE:
            return np.full(len(SIGNALS), TOLERANCE), np.full(2, TOLERANCE)
        return (np.maximum(MARGIN * self.rounding[:, chosen].max(axis=1), TOLERANCE),
                np.maximum(MARGIN * self.last, TOLERANCE))


def _chosen(moved, frozen, limits, number, draw):
    """Return the indices of output times where all forms are within the limits, and half of them in motion."""
    calm = np.logical_and.reduce([one.within(limits) for one in moved])
    moving = np.zeros(calm.size, dtype=bool)
    for one in frozen:
        speed = one.signals[[SIGNALS.index(name) for name in ("output_speed", "motor_speed")]]
        moving |= np.nanmax(np.abs(speed), axis=0) > 1e-3
    order = np.random.default_rng([5, number, draw]).permutation(calm.size)
    if limits is LOOSE:  # the calmer half
        order = order[np.isin(order, np.argsort(sum(one.rounding.max(axis=0) for one in moved))[:calm.size // 2])]
    order = order[calm[order]]
    if order.size < TIMES:
        raise Unfit("moves by rounding")
    half = TIMES // 2 if moving.sum() >= TIMES else 0
    if moving[order].sum() < half:
        raise Unfit("calm only at rest")
    first = order[moving[order]][:half]
    rest = order[~np.isin(order, first)][:TIMES - len(first)]
    return np.sort(np.concatenate([first, rest]))


def _check_effect(number, draw, one, frozen, times, events):
    """Raise Unfit if the only feature of a case does nothing."""
    model, features = plan()[number]
    kinds = {event.kind for event in events}
    if set(features) & set(STOPS) and len(features) < 7 and not kinds & {"upper stop", "lower stop"}:
        raise Unfit("no stop is met")
    if "refused pulses" in features and len(features) < 7 and "pulse refused" not in kinds:
        raise Unfit("no pulse is refused")
    if len(features) == 1 and features[0] in SERVO and features[0] not in ("brake", *STOPS):
        plain = case(model, (), number, draw).model  # the same servo, under the same load and command
        without, _ = run(one._replace(model=plain), times)
        if np.max(moves(frozen.signals, without.signals)) < 1e-9:
            raise Unfit("has no effect")


def _into(one, times, found, moved):
    """Take in how a case moves where it is advanced in pieces, at the cuts."""
    names, states = _pieces(one, times)
    for name, row in zip(names, states, strict=True):
        steps = moves(found[name], row)
        place = SIGNALS.index(name)
        moved.rounding[place] = np.maximum(moved.rounding[place], steps[:-1])
        if name in one.model.layout[:2]:
            at = one.model.layout.index(name)
            moved.last[at] = max(moved.last[at], steps[-1])


def probed(number, draw, limits):
    """Return all that is kept of a draw, by the names of the file.

    Raises
    ------
    Unfit
        If rounding moves it, or its feature does nothing.
    """
    one = case_of(number, draw)
    frozen, result = run(one, [0.5 * one.duration])
    times = _candidates([segment.start for segment in result.trajectory.segments], one.duration, number, draw)
    frozen, result = run(one, times)
    if draw < EFFECT_DRAWS:
        _check_effect(number, draw, one, frozen, times, result.events)
    moved = _Moved(frozen, times)
    for k, factors in enumerate(PROBES):
        other, _ = run(one.with_servo(_values(one.model.servo, factors)), times)
        if (other.events, other.status) != (frozen.events, frozen.status):
            raise Unfit("other events")
        moved.add(other, k)
        moved.check(limits)
    if frozen.status == 0:
        _into(one, times, result, moved)
        moved.check(limits)
    forms, single = [moved], None
    if is_batched(number):
        lanes, status, single = _probed_lanes(one, times)
        if np.ptp(status):
            raise Unfit("other events")
        forms.append(_Moved(frozen._replace(signals=lanes[0]), times))
        for k, lane in enumerate(lanes[1:]):
            forms[1].add(frozen._replace(signals=lane), k)
        forms[1].check(limits)
    chosen = _chosen(forms, [frozen], limits, number, draw)
    times = times[chosen]
    frozen, _ = run(one, times)
    allowed, last_allowed = moved.allowed(chosen, limits)
    kept = frozen._asdict() | {"draw": draw, "time": times, "allowed": allowed, "last_allowed": last_allowed}
    if not is_batched(number):
        return kept
    signals, status = run_lanes(one, times)
    angle = run_lanes(one, times, "float32")[0][0, ANGLE].astype(np.float32)
    if np.max(np.abs(single[1:, chosen] - single[0, chosen])) > SINGLE[0] or np.max(
            np.abs(angle - frozen.signals[ANGLE])) > SINGLE[1]:
        angle = np.full(TIMES, np.nan, dtype=np.float32)
    return kept | {"batch": signals[0], "batch_status": status[0], "single": angle,
                   "batch_allowed": forms[1].allowed(chosen, limits)[0]}


def _probed_lanes(one, times):
    """Return signals and status of lanes with the changes of all probes, the first without; angles in float32."""
    servo = one.model.servo
    table = np.vstack([np.ones(len(PROBED)), PROBES])
    lanes, status = run_lanes(one, times, parameters={
        name: servo.get(name) * table[:, k] for k, name in enumerate(PROBED)})
    columns = {name: servo.get(name) * np.array([1.0, 1.0 + NEAR, 1.0 - NEAR]) for name in PROBED[:2]}
    return lanes, status, run_lanes(one, times, "float32", columns)[0][:, ANGLE]


def probed_bus(number, draw, limits):
    """Return what `probed` does of a bus."""
    bus = bus_of(number, draw)
    _, _, fleet = run_bus(bus, [0.5 * bus.duration])
    starts = [segment.start for result in fleet.values() for segment in result.trajectory.segments]
    times = _candidates(starts, bus.duration, 1000 + number, draw)
    frozen, _, _ = run_bus(bus, times)
    if draw < EFFECT_DRAWS and min(one.events for one in frozen) < 4:
        raise Unfit("little happens")
    forms = [_Moved(one, times) for one in frozen]
    for k, factors in enumerate(PROBES):
        servos = tuple(one.with_servo(_values(one.model.servo, factors)) for one in bus.servos)
        others, _, _ = run_bus(bus._replace(servos=servos), times)
        for form, one, other in zip(forms, frozen, others, strict=True):
            if (other.events, other.status) != (one.events, one.status):
                raise Unfit("other events")
            form.add(other, k)
            form.check(limits)
    chosen = _chosen(forms, frozen, limits, 1000 + number, draw)
    times = times[chosen]
    frozen, voltage, _ = run_bus(bus, times)
    kept = {"draw": draw, "time": times, "voltage": voltage}
    allowed, last_allowed = zip(*(form.allowed(chosen, limits) for form in forms), strict=True)
    return kept | {"allowed": np.array(allowed), "last_allowed": np.array(last_allowed)} | {
        name: np.array([getattr(one, name) for one in frozen]) for name in frozen[0]._fields}


def _search(number, probe, tally):
    """Return what is kept of the first draw that fits; `tally` learns why others did not."""
    for draw, limits in enumerate(LIMITS):
        try:
            return probe(number, draw, limits)
        except Unfit as why:
            tally.append(str(why))
        except UserWarning as why:
            tally.append(f"warns: {str(why)[:60]}")
    raise RuntimeError(f"no draw of case {number} is kept: {collections.Counter(tally)}")


def _put(found, prefix, k, kept):
    for name, value in kept.items():
        into = found[prefix + name]
        if np.ndim(value) and into[k].shape != np.shape(value):  # fewer servos than most
            into[k][:len(value)] = value
        else:
            into[k] = value


def _space(n, *more):
    """Return arrays of all that is kept of n cases, by name."""
    S = (len(SIGNALS), TIMES)
    return {"draw": np.zeros(n, np.int16), "time": np.zeros((n, TIMES)), "signals": np.full((n, *more, *S), np.nan),
            "last": np.full((n, *more, 2), np.nan), "events": np.zeros((n, *more), np.int32),
            "status": np.full((n, *more), -1, np.int8), "allowed": np.full((n, *more, len(SIGNALS)), np.nan),
            "last_allowed": np.full((n, *more, 2), np.nan)}


def write():
    """Search for calm draws of all cases, and write their results."""
    warnings.simplefilter("error")
    began = time.perf_counter()
    n = len(plan())
    found = _space(n) | {
        "batch": np.full((n, len(SIGNALS), TIMES), np.nan), "batch_status": np.full(n, -1, np.int8),
        "batch_allowed": np.full((n, len(SIGNALS)), np.nan), "single": np.full((n, TIMES), np.nan, np.float32)}
    found |= {f"bus_{name}": array for name, array in _space(BUSES, MOST_ON_BUS).items()}
    found["bus_voltage"] = np.zeros((BUSES, TIMES))
    reasons = {}
    for k in range(n):
        reasons[k] = tally = []
        _put(found, "", k, _search(k, probed, tally))
        if k % 25 == 24 or len(tally) > 9:
            print(f"{time.perf_counter() - began:6.0f} s  {described(k, found['draw'][k])}  "
                  f"{dict(collections.Counter(tally))}", flush=True)
    for k in range(BUSES):
        tally = []
        _put(found, "bus_", k, _search(k, probed_bus, tally))
        print(f"{time.perf_counter() - began:6.0f} s  bus {k}: {bus_features(k)}; "
              f"{dict(collections.Counter(tally))}", flush=True)
    np.savez_compressed(FILE, **found)
    print(f"{FILE}: {FILE.stat().st_size / 1e6:.2f} MB, {time.perf_counter() - began:.0f} s")
    _tell(found, reasons)


def _tell(found, reasons):
    """Print what was kept and what was not, by feature."""
    cases = collections.defaultdict(list)
    for k, (model, features) in enumerate(plan()):
        for name in (model, *features):
            cases[name].append(k)
    first = [LIMITS.index(limits) for limits in (RESTLESS, LOOSE)]
    print("feature: cases, alone; draws not kept, and by rounding, amplification or events; cases restless, loose")
    for name, those in cases.items():
        tally = collections.Counter(why for k in those for why in reasons[k])
        tried = len(those) + sum(tally.values())
        moved = sum(tally[why] for why in ("moves by rounding", "amplifies", "other events", "calm only at rest"))
        alone = sum(len(plan()[k][1]) == 1 for k in those)
        draws = found["draw"][those]
        print(f"{name}: {len(those)}, {alone}; {sum(tally.values()) / tried:.0%}, {moved / tried:.0%}; "
              f"{np.sum((draws >= first[0]) & (draws < first[1]))}, {np.sum(draws >= first[1])}")
    print(collections.Counter(why for tally in reasons.values() for why in tally))
    print("draws tried:", sum(map(len, reasons.values())) + len(reasons))
    for name in ("allowed", "batch_allowed", "bus_allowed"):
        print(name, "most by signal where above 1e-12:", {
            SIGNALS[j]: f"{x:.1e}" for j, x in enumerate(np.nanmax(found[name].reshape(-1, len(SIGNALS)), axis=0))
            if x > TOLERANCE}, "cases:", int((found[name] > TOLERANCE).any(axis=-1).sum()))
    batched = found["batch_status"] >= 0
    print("batched:", batched.sum(), "of them float32 kept:", np.isfinite(found["single"]).all(axis=1).sum())
    apart = np.max(moves(found["signals"], found["batch"])[batched], axis=(1, 2))
    print("batch from plain: most", apart.max(), "above 1e-12:",
          {k: f"{x:.0e}" for k, x in zip(np.flatnonzero(batched).tolist(), apart, strict=True) if x > TOLERANCE})


def renew(accuracy):
    """Take over results that have moved by more than is allowed, and by no more than `accuracy`."""
    with np.load(FILE) as file:
        found = dict(file)
    for n in range(len(plan())):
        draw, times = found["draw"][n], found["time"][n]
        one = case_of(n, draw)
        now = run(one, times)[0]
        before = {name: found[name][n] for name in ("signals", "last", "events", "status")}
        moved = {"signals": moves(before["signals"], now.signals).max(axis=-1),
                 "last": moves(before["last"][:, None], now.last[:, None])[:, 0]}
        if is_batched(n):
            lane = run_lanes(one, times)[0][0]
            moved["batch"] = moves(found["batch"][n], lane).max(axis=-1)
        allowed = {"signals": found["allowed"][n], "last": found["last_allowed"][n], "batch": found["batch_allowed"][n]}
        if all((moves_of <= allowed[name]).all() for name, moves_of in moved.items()):
            continue
        most = max(float(np.max(moves_of)) for moves_of in moved.values())
        same = now.events == before["events"] and now.status == before["status"]
        if same and most <= accuracy:
            found["signals"][n], found["last"][n] = now.signals, now.last
            if is_batched(n):
                found["batch"][n] = lane
        print(f"{'renewed' if same and most <= accuracy else 'stays  '} {described(n, draw)}: moved by {most:.1e}, "
              f"events {before['events']} -> {now.events}", flush=True)
    np.savez_compressed(FILE, **found)
