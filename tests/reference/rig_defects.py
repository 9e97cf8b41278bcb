"""Twenty-one things that are wrong with a bench or with what is said of it, as strong as one likes.

Nothing of the package. A defect gives the logs of a bench and what they claim (stamps, angles, load); the file says
nothing of it: it is `file_of` the plain servo. A strength from 0 to 1 runs from hardly to be seen to gross.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .rig import Recording, Servo
from .rig_draws import Run, Truth, random_servo, runs

PERIOD = 1.0 / 30.0  # s, of a loop as LeRobot's
WAKING = 5e-5, 1e-3  # s, by which its turns are too long in the mean
Rng = np.random.Generator
Defect = Callable[[Truth, float, Rng], list[Run]]


def between(low: float, high: float, strength: float) -> float:
    """Return a value that grows evenly in its logarithm."""
    return float(low * (high / low) ** strength)


def _plain(rng: Rng) -> dict[str, float]:
    return {}


def _by(truth: Truth, servo: Servo) -> list[Run]:
    return runs(truth._replace(servo=servo), _plain)


def _told(found: list[Run], change: Callable[[Recording], Recording]) -> list[Run]:
    return [run._replace(said=change(run.said)) for run in found]


def load_friction(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """A gear that loses a share of all torque that goes through it: 0.08 to 0.35 on either side (M5)."""
    share = between(0.08, 0.35, strength)
    return _by(truth, truth.servo._replace(motor_share=share, external_share=share))


def play(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """0.4 to 3 degrees between motor and output."""
    return _by(truth, truth.servo._replace(play=math.radians(between(0.4, 3.0, strength))))


def coast(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """A bridge that opens between drives where the file says that it brakes; there is no half of it."""
    return _by(truth, truth.servo._replace(coasts=1.0))


def wrong_t_min(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """0.2 to 1.5 ms of least drive where the file says none."""
    return _by(truth, truth.servo._replace(t_min=between(2e-4, 1.5e-3, strength)))


def digital_p(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """A processor at 1 to 3 kHz that multiplies its error: full voltage from 15 down to 4 degrees on."""
    return _by(truth, truth.servo._replace(digital_rate=between(1e3, 3e3, float(rng.random())),
                                           digital_gain=1.0 / math.radians(between(15.0, 4.0, strength))))


def bent(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """A potentiometer that reads 0.8 to 5 degrees too much at the ends of the travel, by a parabola."""
    return _by(truth, truth.servo._replace(bend=math.radians(between(0.8, 5.0, strength))))


def falling(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """A supply that falls by 2 to 12 % a second in each log."""
    return _by(truth, truth.servo._replace(fall=between(0.02, 0.12, strength)))


def dropping(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """A supply that drops by 5 to 35 % at once in each log."""
    return _by(truth, truth.servo._replace(drop=between(0.05, 0.35, strength)))


def warming(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """A winding that is 10 to 60 % over its first resistance after the last log."""
    share, found = between(0.1, 0.6, strength), []
    for k in range(4):
        servo = truth.servo._replace(R=truth.servo.R * (1.0 + 0.25 * k * share), warms=0.08 * share)
        found.append(_by(truth, servo)[k])
    return found


def rounded(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """Pulses in whole microseconds, counts of a PCA9685 or whole degrees where the logs say what was asked for."""
    steps = {"rounds": 1e-6} if strength < 0.35 else {"rounds": 0.02 / 4096.0} if strength < 0.65 else {
        "rounds": 1856e-6 / 180.0, "rounds_from": 544e-6}  # Arduino's Servo library
    return runs(truth, lambda rng: dict(steps))


def lost_pulses(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """2 to 25 % of the pulses never arrive."""
    share = between(0.02, 0.25, strength)
    return runs(truth, lambda rng: {"lost": share})


def stamps(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """5 % of the stamps are late, by 2 to 18 ms of a turn of 20."""
    late = between(0.1, 0.9, strength)

    def change(said: Recording) -> Recording:
        time = said.time.copy()
        hit = np.flatnonzero(rng.random(len(time) - 2) < 0.05) + 1
        time[hit] += late * (time[hit + 1] - time[hit])
        return said._replace(time=time)

    return _told(runs(truth, _plain), change)


def clock(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """All stamps are 0.5 to 8 % fast."""
    share = between(0.005, 0.08, strength)
    return _told(runs(truth, _plain), lambda said: said._replace(time=(1.0 + share) * said.time))


def reversed_sign(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """The encoder counts the other way."""
    return _told(runs(truth, _plain), lambda said: said._replace(angle=-said.angle))


def wrapped(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """The encoder begins anew somewhere within the motion: near its edge, or at its middle."""
    found = runs(truth, _plain)
    angles = np.concatenate([run.said.angle for run in found])
    seam = float(np.quantile(angles, 0.98 - 0.48 * strength))
    turn = 2.0 * math.pi
    return _told(found, lambda said: said._replace(angle=np.where(said.angle > seam, said.angle - turn, said.angle)))


def two_servos(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """Half the logs are of another servo: its numbers lie 10 % to four times the usual spread apart."""
    other, power = random_servo(rng), between(0.5, 4.0, strength)
    changed = {name: getattr(truth.servo, name) * (getattr(other, name) / getattr(truth.servo, name)) ** power
               for name in ("R", "J", "forward", "gain")}
    second = truth.servo._replace(**changed, backward=changed["forward"])
    one, two = _by(truth, truth.servo), _by(truth._replace(seed=truth.seed + 1000), second)
    return [one[0], two[0], one[1], two[1], one[2], two[2]]


def wrong_voltage(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """The supply gives 4 to 25 % less than the file says."""
    return _by(truth, truth.servo._replace(V_oc=truth.servo.V_oc * (1.0 - between(0.04, 0.25, strength))))


def wrong_load(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """The logs say 5 to 40 % more inertia and torque than hang on the shaft (20 % in the middle)."""
    share = 1.0 + between(0.05, 0.4, strength)
    said = truth.load._replace(inertia=share * truth.load.inertia, torque=share * truth.load.torque,
                               gravity=share * truth.load.gravity)
    return [run._replace(load=said) for run in runs(truth, _plain)]


def outliers(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """5 % of the angles are anywhere within 0.03 to 1 rad of the true ones."""
    reach = between(0.03, 1.0, strength)

    def change(said: Recording) -> Recording:
        hit = rng.random(len(said.angle)) < 0.05
        return said._replace(angle=said.angle + hit * rng.uniform(-reach, reach, len(hit)))

    return _told(runs(truth, _plain), change)


def dropped_samples(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """3 to 50 % of the lines are missing, and what was commanded in them."""
    share = between(0.03, 0.5, strength)

    def change(said: Recording) -> Recording:
        keep = rng.random(len(said.time)) >= share
        keep[0] = True
        return Recording(*(values[keep] for values in said))

    return _told(runs(truth, _plain), change)


def loop_of_30(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """A loop of 30 Hz whose turns are 0.05 to 1 ms too long, one of 200 by far more; stamps say when they began."""
    waking = between(*WAKING, strength)
    return runs(truth, lambda rng: {"waking": waking, "phase": rng.uniform(0.0, 0.02)}, duration=6.0, sample=PERIOD)


def counted_stamps(truth: Truth, strength: float, rng: Rng) -> list[Run]:
    """The same loop with k/30 s for its stamps, as datasets of LeRobot have it."""
    return _told(loop_of_30(truth, strength, rng), lambda said: said._replace(time=PERIOD * np.arange(len(said.time))))


DEFECTS: dict[str, Defect] = {
    "none": lambda truth, strength, rng: runs(truth, _plain),
    "load friction": load_friction, "play": play, "coast": coast, "wrong t_min": wrong_t_min,
    "digital P servo": digital_p, "lost pulses": lost_pulses, "5 % wrong stamps": stamps, "stamps fast": clock,
    "reversed sign": reversed_sign, "wrapped angle": wrapped, "two servos": two_servos,
    "wrong voltage": wrong_voltage, "wrong load": wrong_load, "outliers 5 %": outliers,
    "dropped samples": dropped_samples, "bent potentiometer": bent, "falling supply": falling,
    "dropping supply": dropping, "warming": warming, "rounded commands": rounded,
    "30 Hz loop": loop_of_30, "counted stamps": counted_stamps,
}


def with_defect(truth: Truth, name: str, strength: float) -> list[Run]:
    """Return the logs of a bench that has a defect."""
    rng = np.random.default_rng([truth.seed, 4, list(DEFECTS).index(name)])
    return DEFECTS[name](truth, strength, rng)
