"""Tables as people make them at home, with their truth: weights, stopwatch, multimeter, protractor; formulas only.

Nothing of the package is used. A servo is six numbers at its output shaft, steady lifting is two straight laws

    (1 - mu) K i = tau_c + (1 + mu) tau,        V - V_d - R i = K w,

and every reading has the noise and the last digit of what it is read with. Each kind and seed gives one table.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

GRAVITY = 9.80665
KINDS = ("current", "speed", "sag", "voltage", "both ways")
DEG = math.pi / 180.0


@dataclass(frozen=True)
class Truth:
    """A servo at its output shaft: SI, angles in rad."""

    K: float
    R: float
    V: float
    V_d: float
    tau_c: float
    mu: float

    @property
    def efficiency(self) -> float:
        return (1.0 - self.mu) / (1.0 + self.mu)

    def current(self, torque: float) -> float:
        return (self.tau_c + (1.0 + self.mu) * torque) / ((1.0 - self.mu) * self.K)

    def speed(self, torque: float, voltage: float | None = None) -> float:
        return ((self.V if voltage is None else voltage) - self.V_d - self.R * self.current(torque)) / self.K

    @property
    def stall_torque(self) -> float:
        most = (self.V - self.V_d) / self.R
        return ((1.0 - self.mu) * self.K * most - self.tau_c) / (1.0 + self.mu)

    @property
    def starts_at(self) -> float:
        """The voltage at which the free shaft begins to turn."""
        return self.V_d + self.R * self.current(0.0)


@dataclass(frozen=True)
class Table:
    """A file's text, the arm or drum that is said beside it (m, None where a column says it), and what is true (SI)."""

    kind: str
    text: str
    servo: Truth
    arm: float | None = None
    figures: dict[str, float] = field(default_factory=dict)


def servo(random: random.Random) -> Truth:
    """Return a servo between a micro and a large standard one."""
    K = 10.0 ** random.uniform(-0.6, 0.2)
    V = random.choice((4.8, 5.0, 6.0, 7.4))
    stall = random.uniform(0.8, 3.0)
    V_d, mu = random.choice((0.0, 0.2, 0.4)), random.choice((0.0, 0.05, 0.11, 0.2))
    return Truth(K=K, R=(V - V_d) / stall, V=V, V_d=V_d, tau_c=K * (1.0 - mu) * stall * random.uniform(0.06, 0.25),
                 mu=mu)


def table(kind: str, seed: int) -> Table:
    """Return one table of a kind."""
    chance = random.Random(f"{kind} {seed}")
    return {"current": _current, "speed": _speed, "sag": _sag, "voltage": _voltage, "both ways": _both_ways}[kind](
        chance, servo(chance))


def _rounded(value: float, step: float) -> str:
    places = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"{round(value / step) * step:.{places}f}"


def _loads(chance: random.Random, most: float, arm: float, rows: int) -> tuple[str, list[str], list[float]]:
    """Return the heading, what is written, and the true torques of weights that a scale weighed."""
    unit = chance.choice(("mass_g", "weight [kg]", "load (N)", "torque_kgf_cm"))
    least = 0.0 if chance.random() < 0.5 else most / rows
    written, torques = [], []
    for k in range(rows):
        mass = (least + (most - least) * k / (rows - 1)) * chance.uniform(0.93, 1.0) / (GRAVITY * arm)
        mass = round(mass, 3)  # what was hung on, as its scale shows it
        torques.append(GRAVITY * arm * (mass + chance.gauss(0.0, 0.0003) if mass else 0.0))
        written.append({"mass_g": f"{1e3 * mass:.0f}", "weight [kg]": f"{mass:.3f}",
                        "load (N)": f"{GRAVITY * mass:.3f}",
                        "torque_kgf_cm": f"{100.0 * mass * arm:.4f}"}[unit])
    return unit, written, torques


def _arm(chance: random.Random, most: float) -> float:
    """Return an arm for which the weights are some hundred grams or more."""
    return chance.choice([arm for arm in (0.01, 0.02, 0.05, 0.1) if most / (GRAVITY * arm) > 0.25] or [0.01])


def _text(header: list[str], columns: list[list[str]]) -> str:
    return "\n".join([",".join(header), *(",".join(row) for row in zip(*columns, strict=True))]) + "\n"


def _hung(chance: random.Random, of: Truth, share: float
          ) -> tuple[list[str], list[list[str]], list[float], float | None]:
    most = share * of.stall_torque
    arm = _arm(chance, most)
    unit, written, torques = _loads(chance, most, arm, chance.randint(5, 9))
    if unit != "torque_kgf_cm" and chance.random() < 0.5:
        return [unit, "arm_cm"], [written, [f"{100.0 * arm:g}"] * len(written)], torques, None
    return [unit], [written], torques, None if unit == "torque_kgf_cm" else arm


def _current(chance: random.Random, of: Truth) -> Table:
    """A multimeter: 2 mA and half a percent of a reading, and the ripple of the brushes."""
    header, columns, torques, arm = _hung(chance, of, 0.9)
    name, scale, step = chance.choice((("current_mA", 1e3, 1.0), ("current_mA", 1e3, 10.0), ("I [A]", 1.0, 0.01)))
    columns.append([_rounded(scale * (i + chance.gauss(0.0, math.hypot(0.004, 0.01 * of.current(0.5 * torques[-1])))),
                             step) for i in map(of.current, torques)])
    return Table("current", _text([*header, name], columns), of, arm, {
        "no-load current": of.current(0.0), "torque per current": of.K * of.efficiency})


def _speed(chance: random.Random, of: Truth) -> Table:
    """A film or a stopwatch on a long drum: 2 % of the speed without load, or 4 ms of a time for 60 degrees."""
    header, columns, torques, arm = _hung(chance, of, 0.75)
    speeds = [of.speed(torque) for torque in torques]
    free = of.speed(0.0)
    kind = chance.choice(("speed_deg_s", "speed [rpm]", "time_60deg_s"))
    if kind == "time_60deg_s":
        read = [_rounded(60.0 * DEG / w + chance.gauss(0.0, 0.004), 0.001) for w in speeds]
    else:
        scale, step = (1.0 / DEG, 1.0) if kind == "speed_deg_s" else (30.0 / math.pi, 0.1)
        read = [_rounded(scale * (w + chance.gauss(0.0, 0.015 * free)), step) for w in speeds]
    return Table("speed", _text([*header, kind], [*columns, read]), of, arm, {
        "no-load speed": free, "stall torque": of.stall_torque})


def _sag(chance: random.Random, of: Truth) -> Table:
    """A protractor, half degrees: a bit of deadband, then a straight spring."""
    header, columns, torques, arm = _hung(chance, of, 0.5)
    compliance = chance.uniform(4.0, 12.0) * DEG / (0.5 * of.stall_torque)
    first = chance.uniform(0.2, 1.0) * DEG
    name, step = chance.choice((("sag_deg", 0.5), ("angle error [deg]", 0.1), ("droop (°)", 0.5)))
    columns.append([_rounded((first + compliance * torque) / DEG + chance.gauss(0.0, 0.3), step)
                    for torque in torques])
    return Table("sag", _text([*header, name], columns), of, arm, {"compliance": compliance, "first sag": first})


def _voltage(chance: random.Random, of: Truth) -> Table:
    """A laboratory supply and a film: 10 mV, 1.5 % of the fastest speed."""
    most = max(of.V, 1.6 * of.starts_at)
    volts = [of.starts_at + (most - of.starts_at) * share for share in (
        0.2, 0.35, 0.5, 0.65, 0.8, 1.0)[chance.randint(0, 1):]]
    volts = [round(v, 2) for v in volts]
    spread = 0.012 * of.speed(0.0, most)
    read = [of.speed(0.0, v) + chance.gauss(0.0, spread) for v in volts]
    name, scale, step = chance.choice((("speed_deg_s", 1.0 / DEG, 1.0), ("speed [rpm]", 30.0 / math.pi, 0.1)))
    return Table("voltage", _text(["supply_voltage_V", name], [
        [f"{v:.2f}" for v in volts], [_rounded(scale * w, step) for w in read]]), of, None, {
            "torque constant": of.K, "voltage of the first turn": of.starts_at})


def _both_ways(chance: random.Random, of: Truth) -> Table:
    """A dial, read on the way up and on the way down at the same pulses; it lags by half of the play each way."""
    slope = chance.uniform(0.085, 0.115)  # deg/us
    play = chance.choice((0.0, 0.4, 1.0, 2.0, 4.2))
    up = [1000.0 + 1000.0 * k / 7 for k in range(8)]
    pulses = [round(x) for x in up] + [round(x) for x in reversed(up[:-1])]
    ways = [-0.5] * len(up) + [0.5] * (len(up) - 1)
    read = [_rounded(slope * (t - 1500.0) + 90.0 + way * play + chance.gauss(0.0, 0.25), 0.1)
            for t, way in zip(pulses, ways, strict=True)]
    text = _text(["pulse_width_us", "output_angle_deg"], [[str(t) for t in pulses], read])
    return Table("both ways", text, of, None, {"hysteresis": play * DEG, "slope": slope * DEG})
