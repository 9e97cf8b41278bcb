"""The table of what may be the matter: each candidate with the settings from which it is tried, and its words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.diagnosis.bench import Setting, TrialBench
from servotwin.identification.fitting.diagnosis.shapes import bent, rounded, wrong_gain
from servotwin.identification.fitting.frames import has_pulses
from servotwin.identification.fitting.free import LUMPED, nominal
from servotwin.loads import Load
from servotwin.logs.log import Log
from servotwin.models import BoundedServo, DigitalServo, Model
from servotwin.parameters import Servo

_EXACT, _OFF = 2e-3, 0.12  # of a clock: as good as any, and more than any is off
_VOLTAGE = "supply.open_circuit_voltage"


@dataclass(frozen=True)
class Candidate:
    """Something that may be the matter.

    Parameters
    ----------
    name : str
    words : str
        What is then said, before the gain.
    remedy : str
    settings : callable
        Returns the settings from which it is tried; none where it makes no sense.
    """

    name: str
    words: str
    remedy: str
    settings: Callable[[TrialBench], Sequence[Setting]]


def numbers(values: Sequence[Mapping[str, float]], fixed: Mapping[str, float | str] | None = None, *,
            price: float = 1.0) -> Callable[[TrialBench], Sequence[Setting]]:
    """Return settings that search numbers of the servo which it leaves out, from several values (SI).

    What the servo gives already, other than the value that changes nothing, or what is searched already, is not tried.
    """
    def settings(bench: TrialBench) -> Sequence[Setting]:
        old = bench.setting.model
        if any(name not in (*old.requires, *old.optional) or name in bench.old.space.names
               or _matters(old.servo, name) for start in values for name in start):
            return ()
        given = dict(fixed or {})
        return [Setting(bench.setting.logs, type(old)(old.servo.replace({**given, **start}, source="a trial")),
                        start, price=price) for start in values]
    return settings


_NEUTRAL: dict[str, float] = {"friction.breakaway_ratio": 1.0}


def _matters(servo: Servo, name: str) -> bool:
    value = servo.get(name)
    return value is not None and value != _NEUTRAL.get(name, 0.0)


def scaled(name: str, factors: Sequence[float]) -> Callable[[TrialBench], Sequence[Setting]]:
    """Return settings that search a number which the servo gives, from several shares of it."""
    def settings(bench: TrialBench) -> Sequence[Setting]:
        old = bench.setting.model
        value = nominal(old.servo, name)
        if not value or name in bench.old.space.names:
            return ()
        logs = tuple(replace(log, parameters={k: v for k, v in log.parameters.items() if k != name})
                     for log in bench.setting.logs)
        said = {log.parameters.get(name, value) for log in bench.setting.logs}
        if len(said) > 1:
            return ()
        there = said.pop()
        return [Setting(logs, type(old)(old.servo.replace({name: there}, source="a trial")), {name: factor * there})
                for factor in factors]
    return settings


def turned(bench: TrialBench) -> Sequence[Setting]:
    """Return the setting in which the bridge opens between pulses where it brakes, and the other way round."""
    old = bench.setting.model
    if "electronics.off_state" not in old.optional:
        return ()
    other = "brake" if old.servo.get("electronics.off_state") == "coast" else "coast"
    return [Setting(bench.setting.logs, type(old)(old.servo.replace({"electronics.off_state": other},
                                                                    source="a trial")), afresh=True)]


def directed(bench: TrialBench) -> Sequence[Setting]:
    """Return the setting in which Coulomb friction is another one each way."""
    old, names = bench.setting.model, bench.old.space.names
    forward, backward = LUMPED["output_coulomb_torque"][0]
    if "output_coulomb_torque" in names:
        there = dict(zip(names, bench.old.space.values(bench.point.shared[None, :len(names)])[0], strict=True))
        each = there["output_coulomb_torque"] / float(nominal(old.servo, "gear.gear_reduction") or 1.0)
    elif forward not in names and backward not in names:
        each = float(nominal(old.servo, forward) or 0.0)
    else:
        return ()
    if each <= 0.0:
        return ()
    return [Setting(bench.setting.logs, old, {forward: each, backward: each}, ("output_coulomb_torque",))]


def heavier(bench: TrialBench) -> Sequence[Setting]:
    """Return settings in which all loads are some shares of what the logs say."""
    if not any(log.load != Load() for log in bench.setting.logs) or any(
            name.startswith("load.") for name in bench.old.space.names):
        return ()
    return [Setting(tuple(replace(log, load=_times(log.load, factor)) for log in bench.setting.logs),
                    bench.setting.model) for factor in (0.7, 0.83, 1.2, 1.4)]


def _times(load: Load, factor: float) -> Load:
    """Return a load with inertia, torque and masses a share larger."""
    pendulums = tuple(replace(p, mass=factor * p.mass, inertia=None if p.inertia is None else factor * p.inertia)
                      for p in load.pendulums)
    return replace(load, inertia=factor * load.inertia, torque=factor * load.torque, pendulums=pendulums)


def like_digital(bench: TrialBench) -> Sequence[Setting]:
    """Return settings of a servo without pulses and deadband that multiplies its error by a gain."""
    old = bench.setting.model
    if isinstance(old, BoundedServo | DigitalServo):
        return ()
    servo, names = old.servo, bench.old.space.names
    there = dict(zip(names, bench.old.space.values(bench.point.shared[None, :len(names)])[0], strict=True))
    gain = there.get("electronics.stretcher_gain", servo.get("electronics.stretcher_gain") or 0.0)
    slope = there.get("electronics.one_shot_slope", servo.get("electronics.one_shot_slope") or 0.0)
    if not (isinstance(gain, float) and gain > 0.0 and isinstance(slope, float) and slope > 0.0):
        return ()
    loss = float(servo.get("supply.bridge_drop_voltage") or 0.0)  # type: ignore[arg-type]
    mean = (old.value(_VOLTAGE) - loss) * gain / (old.value_or("electronics.frame_period", 0.02) / slope)
    plain = servo.replace({"electronics.comparator_gain": 1.0, "electronics.bridge_gain": mean,
                           "electronics.voltage_deadband": 0.0}, source="a trial")
    model: Model = BoundedServo(plain)
    read = (*model.requires, *model.optional, *LUMPED)
    lost = tuple(name for name in names if name not in read and not name.startswith("load."))
    nuisance = tuple(dict.fromkeys(name for name in (*bench.old.nuisance, "delay", "log_delay")
                                   if name not in ("frame_phase", "frame_period", "control_phase", "angle_sag")))
    return [Setting(bench.setting.logs, model, {"electronics.bridge_gain": factor * mean}, lost, nuisance)
            for factor in (0.3, 1.0, 3.0)]


def clocks(more: Sequence[str]) -> Callable[[TrialBench], Sequence[Setting]]:
    """Return the setting with further nuisances of pulses."""
    def settings(bench: TrialBench) -> Sequence[Setting]:
        nuisance = tuple(dict.fromkeys((*bench.old.nuisance, *more)))
        if set(more) <= set(bench.old.nuisance) or not has_pulses(bench.setting.model):
            return ()
        return [replace(bench.setting, nuisance=nuisance)]
    return settings


def stretched(bench: TrialBench) -> Sequence[Setting]:
    """Return the setting whose samples are as far apart as pulses, or a whole multiple, where they nearly are."""
    period = bench.cases[0].period
    if not period:
        return ()
    step = float(np.median([np.median(np.diff(log.time)) for log in bench.setting.logs]))
    ratio = step / period if step > period else period / step
    off = ratio / round(ratio) if step > period else round(ratio) / ratio
    if not _EXACT < abs(off - 1.0) < _OFF:
        return ()
    logs = tuple(replace(log, time=log.time[0] + (log.time - log.time[0]) / off) for log in bench.setting.logs)
    nuisance = tuple(name for name in bench.old.nuisance if name != "frame_period")
    return [replace(bench.setting, logs=logs, nuisance=nuisance, afresh=True)]


def backlash(bench: TrialBench) -> Sequence[Setting]:
    """Return settings with play between motor and output, whose own inertia is a small share."""
    inertia = nominal(bench.setting.model.servo, "output_inertia")
    if not inertia:
        return ()
    own = {} if bench.setting.model.servo.get("gear.output_inertia") else {"gear.output_inertia": 0.05 * inertia}
    return [replace(one, afresh=True)  # the fit has bent inertia and friction
            for one in numbers(({"gear.backlash": 0.006}, {"gear.backlash": 0.02}), own, price=3.0)(bench)]


TABLE: tuple[Candidate, ...] = (
    Candidate("frame phase", "pulses that come at other times than the log's samples", 'nuisance "frame_phase"',
              clocks(("frame_phase",))),
    Candidate("frame period", "pulses of another period", 'nuisance "frame_period"',
              clocks(("frame_phase", "frame_period"))),
    Candidate("stamps", "stamps that run at another rate: samples and pulses would be in step", "check the clock that "
              "stamps the samples, or the sampling rate", stretched),
    Candidate("rounded commands", "commands that were rounded on their way", "record what is sent, or send more finely",
              rounded),
    Candidate("P register", "another gain of the loop than registers or logs say", "read the register for P back, or "
              "search firmware.proportional_gain", wrong_gain),
    Candidate("bent potentiometer", "a potentiometer that is not linear", "measure some angles by hand, and give "
              "potentiometer.linearity_angle and linearity_error", bent),
    Candidate("minimum drive time", "a minimum drive time of the chip", "search electronics.minimum_drive_time",
              numbers(({"electronics.minimum_drive_time": 2e-4}, {"electronics.minimum_drive_time": 8e-4}))),
    Candidate("coast", "a bridge that opens between pulses where the file brakes, or brakes where it opens",
              "turn electronics.off_state", turned),
    Candidate("directed friction", "friction that differs by direction",
              "search friction.coulomb_torque_forward and friction.coulomb_torque_backward", directed),
    Candidate("viscous friction", "viscous friction", "search motor.motor_viscous_friction",
              numbers(({"motor.motor_viscous_friction": 1e-7}, {"motor.motor_viscous_friction": 1e-6}))),
    Candidate("voltage", "another supply voltage", f"measure the voltage, or search {_VOLTAGE}",
              scaled(_VOLTAGE, (0.8, 0.9, 1.1, 1.25))),
    Candidate("load", "another load than the logs say", "weigh the load and measure its arm", heavier),
    Candidate("breakaway", "friction that holds more at rest than in motion", "search friction.breakaway_ratio",
              numbers(({"friction.breakaway_ratio": 1.3}, {"friction.breakaway_ratio": 1.8}))),
    Candidate("digital", "acts like a digital servo: a drive in proportion to the error, without pulses",
              "model BoundedServo without a deadband", like_digital),
    Candidate("play at the potentiometer", "play between output and potentiometer", "search potentiometer.backlash",
              numbers(({"potentiometer.backlash": 0.006}, {"potentiometer.backlash": 0.02}), price=3.0)),
    Candidate("load friction", "friction that grows with the load", "search friction.load_friction, or climb the "
              "friction ladder", numbers(({"friction.load_friction": 0.08}, {"friction.load_friction": 0.25}),
                                         price=10.0)),
    Candidate("play", "play in the gear", "search gear.backlash, with gear.output_inertia above 0", backlash),
)
"""What is tried, the cheap first; of candidates that gain alike the earlier one is named first."""


def possible(candidate: Candidate, bench: TrialBench) -> Sequence[Setting]:
    """Return the settings of a candidate; none where the servo does not allow it."""
    try:
        return candidate.settings(bench)
    except ServotwinError:
        return ()


def mended_logs(bench: TrialBench, mended: Mapping[str, Log]) -> Sequence[Setting]:
    """Return the setting with the logs that a finding has mended."""
    logs = tuple(mended.get(log.name, log) for log in bench.setting.logs)
    if all(a is b for a, b in zip(logs, bench.setting.logs, strict=True)):
        return ()
    return [replace(bench.setting, logs=logs, afresh=True)]
