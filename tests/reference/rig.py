"""A bench with one servo on it, by small fixed steps: nothing of the package, only what the specification says.

`record` gives what the log of such a bench says: a loop writes a pulse width and reads an encoder, a generator sends
frames by a clock of its own, and the servo answers. Everything is SI, at the output shaft, and right-continuous.
Heun's rule with steps of 10 µs: drives that begin or end within a step count for the share of it that they fill.

It is imported as `reference.rig` everywhere, never relatively: it is compiled as a kernel is, under that name.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.simulation.compile import Recipe, kernels

Array = NDArray[np.float64]

STEP = 1e-5  # s
SAMPLE = 0.02  # s, of the loop
BEFORE = 1.0  # s for which the servo held the first command before the log begins
_SAME = 1e-9  # s: a command that arrives so little after an edge arrives with it


class Servo(NamedTuple):
    """Motor, gear, bridge and chip; numbers alone, so that compiled code takes it as it is.

    The defaults are a servo of the 100 g class at 6 V; those of defects are off.
    """

    R: float = 3.04  # Ω, armature
    K: float = 1.04  # N m/A and V s/rad
    J: float = 6e-3  # kg m², of motor and gear
    B: float = 0.0  # N m s/rad
    forward: float = 0.263  # N m, resists w > 0
    backward: float = 0.263
    breakaway: float = 1.0
    stribeck: float = 0.0  # rad/s, the speed by which what holds at rest has fallen to 1/e; 0: it holds at rest alone
    load_share: float = 0.0  # K_l of M3
    motor_share: float = 0.0  # K_m of M5
    external_share: float = 0.0  # K_e of M5
    V_oc: float = 6.0
    fall: float = 0.0  # 1/s, the share of it that is lost from the start of a log on
    drop: float = 0.0  # the share of it that is lost at once, 40 % through a log
    warms: float = 0.0  # 1/s, by which share R rises from the start of a log on
    R_b: float = 0.0  # of the source
    V_ce0: float = 0.4
    r_c: float = 0.0
    V_br: float = 0.0
    coasts: float = 0.0  # 1: the bridge opens between drives
    play: float = 0.0  # rad, motor to output
    wheel: float = 0.0  # kg m², of what is behind the play
    bearing: float = 0.06  # of the smaller dry friction: what of it acts on the output inside the play
    wiper_play: float = 0.0  # rad, output to potentiometer
    bend: float = 0.0  # rad: what the potentiometer reads too much 0.6 rad beside the middle; it grows with the square
    zero: float = 0.64e-3  # s, length of the one-shot at q = 0
    slope: float = 573e-6  # s/rad, s_µ
    gain: float = 120.0  # of the stretcher
    deadband: float = 8e-6  # s, full width
    t_min: float = 0.0
    timeout: float = math.inf
    digital_rate: float = 0.0  # Hz; above 0 a processor drives: duty = P e
    digital_gain: float = 15.0  # 1/rad
    digital_deadband: float = 2e-3  # rad, half width
    digital_counts: float = 0.0  # rad


class Load(NamedTuple):
    """What hangs on the shaft; `torque` > 0 pushes towards −q."""

    inertia: float = 0.0
    torque: float = 0.0
    viscous: float = 0.0
    gravity: float = 0.0  # m g l
    hanging: float = 0.0  # rad


class Recording(NamedTuple):
    """What a log says, and what is true of it."""

    time: Array  # stamps [s]
    command: Array  # pulse widths [s]
    angle: Array  # what the encoder said [rad]
    true_time: Array
    true_angle: Array


def _external(load: Load, q: float, w: float) -> float:
    """Torque of the load on the shaft in +q."""
    pull = load.gravity * math.sin(q - load.hanging) if load.gravity != 0.0 else 0.0
    return -load.torque - pull - load.viscous * w


class Supplied(NamedTuple):
    """What changes in the course of a log: the voltage without load, and how many times as high R is."""

    V: float
    warm: float


def _supplied(s: Servo, t: float, half: float) -> Supplied:
    """Return supply and warmth at a time; `half` is when a supply that drops does so."""
    V = s.V_oc * (1.0 - s.fall * max(t, 0.0))
    if t > half:
        V *= 1.0 - s.drop
    return Supplied(V, 1.0 + s.warms * max(t, 0.0))


def _current(s: Servo, now: Supplied, w: float, sign: float) -> float:
    """Armature current while driven (sign ±1) or off (0); none where the voltage does not exceed what is lost."""
    R_a = s.R * now.warm
    if sign != 0.0:
        source, lost, R = sign * now.V, s.V_ce0 + s.V_br, R_a + s.r_c + s.R_b
    elif s.coasts != 0.0:
        source, lost, R = 0.0, now.V + s.V_ce0 + s.V_br, R_a + s.R_b
    else:
        source, lost, R = 0.0, s.V_br, R_a
    x = source - s.K * w
    return 0.0 if abs(x) <= lost else (x - math.copysign(lost, x)) / R


def _motor(s: Servo, now: Supplied, w: float, forth: float, back: float) -> float:
    """Mean motor torque of a step of which shares are driven forward and backward; beyond 1 `forth` is a duty + 10."""
    if forth > 1.5:
        return s.K * ((forth - 10.0) * (now.V - s.V_ce0) - s.K * w) / (s.R * now.warm + s.r_c + s.R_b)
    i = (1.0 - forth - back) * _current(s, now, w, 0.0)
    if forth > 0.0:
        i += forth * _current(s, now, w, 1.0)
    if back > 0.0:
        i += back * _current(s, now, w, -1.0)
    return s.K * i


def _budget(s: Servo, side: float, at_rest: bool, w: float, motor: float, external: float) -> float:
    """Dry friction that resists motion towards `side`."""
    coulomb = s.forward if side > 0.0 else s.backward
    if at_rest:
        coulomb *= s.breakaway
    elif s.stribeck > 0.0:
        coulomb *= 1.0 + (s.breakaway - 1.0) * math.exp(-abs(w) / s.stribeck)
    return (coulomb + s.load_share * abs(motor - external)
            + abs(s.motor_share * motor - s.external_share * external))


def _rate(s: Servo, now: Supplied, load: Load, J: float, q: float, w: float, side: float, forth: float, back: float,
          carries: bool, less: float) -> float:
    """Acceleration of motor and what it carries, sliding towards `side`; `less` of the friction is elsewhere."""
    motor = _motor(s, now, w, forth, back)
    external = _external(load, q, w) if carries else 0.0
    return (motor + external - s.B * w - side * (_budget(s, side, False, w, motor, external) - less)) / J


def _slide(s: Servo, now: Supplied, load: Load, J: float, q: float, w: float, forth: float, back: float,
           carries: bool, h: float, less: float = 0.0):
    """Angle and speed after a step of the motor and what it carries; it sticks where friction holds it."""
    side = math.copysign(1.0, w)
    if w == 0.0:
        motor = _motor(s, now, 0.0, forth, back)
        external = _external(load, q, 0.0) if carries else 0.0
        push = motor + external
        side = math.copysign(1.0, push)
        if abs(push) <= _budget(s, side, True, 0.0, motor, external) - less:
            return q, 0.0
    first = _rate(s, now, load, J, q, w, side, forth, back, carries, less)
    if w == 0.0 and first * side <= 0.0:
        return q, 0.0
    second = _rate(s, now, load, J, q + h * w, w + h * first, side, forth, back, carries, less)
    end = w + 0.5 * h * (first + second)
    if end * side <= 0.0:
        return q + 0.5 * h * w * abs(w) / max(abs(w - end), 1e-300), 0.0
    return q + 0.5 * h * (w + end), end


def _fall(load: Load, J: float, q: float, w: float, h: float, dry: float):
    """Angle and speed after a step of an output that the motor does not touch; its bearing may hold it."""
    side = math.copysign(1.0, w)
    if w == 0.0:
        push = _external(load, q, 0.0)
        side = math.copysign(1.0, push)
        if abs(push) <= dry:
            return q, 0.0
    first = (_external(load, q, w) - side * dry) / J
    second = (_external(load, q + h * w, w + h * first) - side * dry) / J
    end = w + 0.5 * h * (first + second)
    if dry > 0.0 and w != 0.0 and end * side <= 0.0:
        return q + 0.5 * h * w * abs(w) / max(abs(w - end), 1e-300), 0.0
    return q + 0.5 * h * (w + end), end


def _two_bodies(s: Servo, now: Supplied, load: Load, body: Array, forth: float, back: float, h: float) -> None:
    """Advance motor (0, 1) and output (2, 3), which touch at side `body[4]` of the play, or do not (0)."""
    J_o = s.wheel + load.inertia
    behind = s.bearing * min(s.forward, s.backward)
    apart_m, w_m = _slide(s, now, load, s.J, body[0], body[1], forth, back, False, h, behind)
    apart_o, w_o = _fall(load, J_o, body[2], body[3], h, behind)
    if body[4] != 0.0 and body[4] * (w_m - w_o) >= 0.0:  # left to themselves they would not draw apart
        body[0], body[1] = _slide(s, now, load, s.J + J_o, body[0], body[1], forth, back, True, h)
        body[2], body[3] = body[0] - 0.5 * body[4] * s.play, body[1]
        return
    body[0], body[1], body[2], body[3], body[4] = apart_m, w_m, apart_o, w_o, 0.0
    gap = body[0] - body[2]
    if abs(gap) >= 0.5 * s.play and gap * (w_m - w_o) > 0.0:  # a plastic impact
        body[4] = math.copysign(1.0, gap)
        body[1] = body[3] = (s.J * w_m + J_o * w_o) / (s.J + J_o)
        body[2] = body[0] - 0.5 * body[4] * s.play


def _duty(s: Servo, width: float, q: float) -> float:
    """Duty of a processor that multiplies its error."""
    if s.digital_counts > 0.0:
        q = s.digital_counts * round(q / s.digital_counts)
    error = (width - s.zero) / s.slope - q
    return 0.0 if abs(error) <= s.digital_deadband else min(max(s.digital_gain * error, -1.0), 1.0)


def _run(s: Servo, load: Load, edges: Array, widths: Array, times: Array, start: float, angle: float, h: float,
         body: Array, out: Array) -> None:
    """Put angles at sorted times into `out`; `widths` are the pulses at the edges, nan where one is lost.

    `body` has room for five numbers, all 0 at first.
    """
    body[0] = body[2] = angle
    carried = s.J + load.inertia + s.wheel
    wiper, frame, done = angle, 0, 0
    sign, until = 0.0, -1e300  # of the drive
    pending, next_sign, next_length = 1e300, 0.0, 0.0
    limp = 1e300
    seen, tick, duty = math.nan, 0, 0.0
    half = 0.4 * times[times.size - 1]
    n = 0
    while done < times.size:
        t = start + n * h
        n += 1
        end = start + n * h
        q, w = body[2], body[3]
        if frame < edges.size and edges[frame] < end:
            width = widths[frame]
            if not math.isnan(width):
                angle = wiper + (w * (edges[frame] - t) if s.wiper_play == 0.0 else 0.0)
                shot = max(0.0, s.zero + s.slope * (angle + s.bend * ((angle - 1.5) / 0.6) ** 2))
                error = width - shot
                over = abs(error) - 0.5 * s.deadband
                pending = edges[frame] + max(width, shot)
                next_sign = math.copysign(1.0, error) if over > 0.0 else 0.0
                next_length = s.t_min + s.gain * over if over > 0.0 else 0.0
                limp = edges[frame] + s.timeout
            frame += 1
        now = _supplied(s, t, half)
        forth = back = 0.0
        if s.digital_rate > 0.0:
            if pending < end:
                seen, pending = widths[frame - 1], 1e300
            if t >= start + tick / s.digital_rate:
                tick += 1
                duty = 0.0 if math.isnan(seen) or t >= limp else _duty(s, seen, wiper)
            forth = 10.0 + duty
        else:
            for _ in range(2):
                stop = min(end, pending)
                share = max(0.0, min(stop, until, limp) - t) / h
                if sign > 0.0:
                    forth += share
                elif sign < 0.0:
                    back += share
                if pending >= end:
                    break
                t = max(t, pending)
                sign, until, pending = next_sign, pending + next_length, 1e300
        if s.play > 0.0:
            _two_bodies(s, now, load, body, forth, back, h)
        else:
            body[2], body[3] = _slide(s, now, load, carried, q, w, forth, back, True, h)
        wiper = min(max(wiper, body[2] - 0.5 * s.wiper_play), body[2] + 0.5 * s.wiper_play)
        while done < times.size and times[done] < end:
            share = max(times[done] - (end - h), 0.0) / h  # before the start it rests
            out[done] = q + share * (body[2] - q)
            done += 1


_COMPILED = Recipe("rig", ("reference.rig:_run",))


def angles(servo: Servo, load: Load, edges: Array, widths: Array, times: Array, *, start: float = 0.0,
           angle: float | None = None, step: float = STEP) -> Array:
    """Return the angle at some times of a servo that gets pulses of some widths at some edges.

    It is at rest at `start`, without drive, where its first pulse leads unless an angle is given.
    """
    first = widths[np.isfinite(widths)][0]
    begin = (first - servo.zero) / servo.slope if angle is None else angle
    order = np.argsort(times, kind="stable")
    found, ordered = np.empty(len(times)), np.empty(len(times))
    kernels(_COMPILED)._run(
        Servo(*map(float, servo)), Load(*map(float, load)), np.asarray(edges, float), np.asarray(widths, float),
        np.asarray(times, float)[order], float(start), float(begin), step, np.zeros(5), ordered)
    found[order] = ordered
    return found


def frames(commands: Array, arrivals: Array, first: float, last: float, *, phase: float,
           period: float) -> tuple[Array, Array]:
    """Return the edges phase + k period from `first` to `last`, and the command that each finds."""
    edges = phase + period * np.arange(math.ceil((first - phase) / period), math.floor((last - phase) / period) + 1)
    found = np.searchsorted(arrivals, edges + _SAME, side="right") - 1
    return edges, commands[np.maximum(found, 0)]


def record(
    servo: Servo, load: Load, command: Array, *, sample: float = SAMPLE, noise: float = 1e-3, ar: float = 0.0,
    counts: float | None = None, stamp_jitter: float = 0.0, loop_jitter: float = 0.0, waking: float = 0.0,
    clock: float = 0.0, phase: float = 0.0, period: float = 0.02, delay: float = 0.0, angle_offset: float = 0.0,
    lost: float = 0.0, before: float = BEFORE, seed: int = 0,
) -> Recording:
    """Return what a loop writes down that sets a pulse width and reads the encoder every `sample` seconds.

    Parameters
    ----------
    command : ndarray, shape (n,)
        Pulse widths, one a turn of the loop [s].
    noise : float
        Of the encoder, rms [rad].
    ar : float
        Correlation of the noise from one sample to the next.
    counts : float, optional
        Of the encoder [rad].
    stamp_jitter : float
        Of the stamps alone, rms [s]; they stay in order.
    loop_jitter : float
        By how much a turn of the loop begins late or early, rms [s]; stamps say so.
    waking : float
        By how much each turn is longer than `sample` in the mean, and one of 200 by 5 to 25 ms [s]; stamps say so.
    clock : float
        The log's clock runs faster than the generator's by this share.
    phase : float
        Of the frames, after the arrival of the first command [s].
    period : float
        Of the frames [s].
    delay : float
        From writing a command to its arrival at the generator [s].
    angle_offset : float
        Measured less true angle [rad].
    lost : float
        Share of pulses that the servo never gets.
    before : float
        For how long the servo has held the first command when the log begins [s]; 0: it begins at rest, without drive.
    """
    rng = np.random.default_rng(seed)
    turns = sample * np.arange(len(command))
    if loop_jitter:
        turns = turns + np.clip(loop_jitter * rng.standard_normal(len(turns)), -0.4 * sample, 0.4 * sample)
    if waking:
        long = (rng.random(len(turns)) < 0.005) * rng.uniform(5e-3, 25e-3, len(turns))
        turns = turns + np.append(0.0, np.cumsum(rng.exponential(waking, len(turns)) + long)[:-1])
    arrivals = turns + delay
    start = turns[0] - before
    edges, widths = frames(command, arrivals, start if before else arrivals[0] + phase - _SAME, turns[-1] + sample,
                           phase=arrivals[0] + phase, period=period)
    if lost:
        widths = np.where((rng.random(len(widths)) < lost) & (edges > turns[0]), np.nan, widths)
    exact = angles(servo, load, edges, widths, turns, start=start if before else arrivals[0])
    e = rng.standard_normal(len(turns))
    for k in range(1, len(e)):
        e[k] = ar * e[k - 1] + math.sqrt(1.0 - ar**2) * e[k]
    angle = exact + angle_offset + noise * e
    if counts:
        angle = counts * np.round(angle / counts)
    stamps = turns * (1.0 + clock)
    if stamp_jitter:
        stamps = stamps + np.clip(stamp_jitter * rng.standard_normal(len(turns)), -0.49 * sample, 0.49 * sample)
        stamps = stamps - stamps[0]
    return Recording(stamps, np.array(command, float), angle, turns, exact)
