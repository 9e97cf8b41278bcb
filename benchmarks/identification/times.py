"""Part 6: seconds of CPU that typical fits take, default ones and first results, and how far estimates are off.

    python benchmarks/identification/times.py [ROW ...] [first | standin]

A default fit has intervals, a verdict and the simpler models beside it; a first result has none of these. CPU time is
that of all threads, kernels being there. `standin` prints what first results of lanes that go nearly say, alone, beside
those of the engine, in shares of the engine's intervals. Rows `xl330` and `miuzei` need the measured logs beside the
repository.
"""

import math
import sys
import time as clock
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "measured"))

import miuzei
import xl330

import servotwin as st
from reference import rig
from reference import rig_draws as draws
from reference.rig_logs import REDUCTION, log_of
from servotwin.identification.fitting.search.task import Task

DATA = next((one for up in Path(__file__).resolve().parents if (one := up / "shared" / "data").is_dir()), None)
XL330 = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
         "motor.motor_viscous_friction", "friction.load_friction")
FIRST = {"intervals": False, "diagnose": False, "compare_with": ()}
PLANT = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque")
ENCODER = 2.0 * math.pi / 4096.0  # rad


class Row(NamedTuple):
    """One fit: logs, the servo file, what `identify` is told, and what is true (SI), as far as it is known."""

    logs: list[st.Log]
    servo: st.Servo
    options: dict[str, Any]
    truth: dict[str, float]


def _bench_servo(servo: st.Servo, rng: np.random.Generator) -> rig.Servo:
    """Return a servo of the bench that is one of those which a servo file describes."""
    def of(name: str) -> float:
        return float(servo.get(name))

    spread = {name: share ** rng.uniform(-1.0, 1.0) for name, share in
              (("R", 1.1), ("K", 1.05), ("J", 1.4), ("forward", 1.08), ("gain", 1.3))}
    K, forward = REDUCTION * of("motor.torque_constant"), REDUCTION * of("friction.coulomb_torque_forward")
    slope, gain = of("electronics.one_shot_slope"), of("potentiometer.feedback_gain")
    reduction = of("gear.gear_reduction")
    return rig.Servo(
        R=of("motor.armature_resistance") * spread["R"], K=K / REDUCTION * reduction * spread["K"],
        J=of("motor.rotor_inertia") * reduction**2 * spread["J"],
        forward=forward / REDUCTION * reduction * spread["forward"],
        backward=forward / REDUCTION * reduction * spread["forward"],
        V_oc=of("supply.open_circuit_voltage"), V_ce0=of("supply.bridge_drop_voltage"),
        zero=of("electronics.one_shot_offset") + slope * of("potentiometer.feedback_offset"), slope=slope * gain,
        gain=of("electronics.stretcher_gain") * spread["gain"], deadband=of("electronics.deadband"))


def _truth(servo: rig.Servo) -> dict[str, float]:
    return {"motor.armature_resistance": servo.R, "output_torque_constant": servo.K, "output_inertia": servo.J,
            "output_coulomb_torque": servo.forward, "electronics.stretcher_gain": servo.gain}


def _widths(duration: float, sample: float, rng: np.random.Generator) -> np.ndarray:
    """Return pulse widths of all motions one after the other [s]."""
    share = duration / len(draws.MOTIONS)
    parts = [draws.motion(kind, share, rng, sample)[:round(share / sample)] for kind in draws.MOTIONS]
    return np.concatenate(parts)


def _bench(name: str, loads: list[rig.Load], duration: float, sample: float, seed: int, **taking: Any) -> Row:
    """Return a fit of logs of the independent bench, all motions in each of them."""
    rng = np.random.default_rng([seed, 7])
    file = st.load_servo(name)
    servo = _bench_servo(file, rng)
    logs = []
    for k, load in enumerate(loads):
        said = rig.record(servo, load, _widths(duration, sample, rng), delay=0.022, angle_offset=0.01,
                          sample=sample, seed=seed + k, **taking)
        logs.append(log_of(said, load, f"{k + 1}", "all"))
    return Row(logs, file, {}, _truth(servo))


def hs755hb() -> Row:
    """HS-755HB, 30 s at 50 Hz, a disc."""
    return _bench("hitec-hs-755hb", [rig.Load(inertia=1e-2, torque=0.2)], 30.0, 0.02, 1)


def pendulums() -> Row:
    """HS-755HB, two pendulums in four logs of 8 s at 50 Hz."""
    arms = [rig.Load(inertia=8e-3, gravity=0.35, hanging=1.2), rig.Load(inertia=1.6e-2, gravity=0.6, hanging=1.2)]
    return _bench("hitec-hs-755hb", [*arms, *arms], 8.0, 0.02, 2)


def mg996r() -> Row:
    """MG996R, two logs of 6 s at 1 kHz, a disc and another one; made by the engine, white noise."""
    file, rng = st.load_servo("towerpro-mg996r"), np.random.default_rng(3)
    truth = _other(file, {"R": 1.1, "K": 1.04, "J": 0.8, "F": 1.1})
    logs = []
    for k, load in enumerate((st.loads.Inertia(3e-3), st.loads.Inertia(8e-3) + st.loads.Constant(0.15))):
        time = 1e-3 * np.arange(6000)
        widths = np.repeat(_widths(6.0, 0.02, rng), 20)[:len(time)]
        log = st.Log(name=f"{k + 1}", motion="all", time=time, command=widths, command_kind="pulse_width", load=load,
                     measured={"output_angle": np.zeros(len(time))})
        seen = _run(truth.replace({"firmware.control_phase": 3e-4 * (k + 1)}), log, 0.006)
        seen = seen + 1e-3 * rng.standard_normal(len(time))
        logs.append(replace(log, measured={"output_angle": seen}))
    return Row(logs, file, {}, _true(truth))


def _other(file: st.Servo, factors: dict[str, float]) -> st.Servo:
    """Return a servo that differs from its file by some factors."""
    names = {"R": ("motor.armature_resistance",), "K": ("motor.torque_constant", "motor.back_emf_constant"),
             "J": ("motor.rotor_inertia",),
             "F": ("friction.coulomb_torque_forward", "friction.coulomb_torque_backward")}
    return file.replace({name: factor * file.get(name) for key, factor in factors.items() for name in names[key]})


def _run(servo: st.Servo, log: st.Log, delay: float) -> np.ndarray:
    """Return the angles of a digital servo at the times of a log, as old as a delay [rad]."""
    signal = log.signal(servo.electronics.frame_period if servo.electronics.one_shot_slope else None)
    kind = log.command_kind == "angle"
    lanes = st.simulate_many(st.DigitalServo(servo), [signal], duration=float(log.time[-1]), load=log.load,
                             output_times=np.maximum(log.time - delay, 0.0),
                             initial={"output_angle": float(log.command[0])} if kind else None)
    return np.asarray(lanes["output_angle"][0])


def _true(truth: st.Servo) -> dict[str, float]:
    N = truth.gear.gear_reduction
    return {"motor.armature_resistance": truth.motor.armature_resistance,
            "output_torque_constant": N * truth.motor.torque_constant,
            "output_inertia": N**2 * truth.motor.rotor_inertia,
            "output_coulomb_torque": N * truth.friction.coulomb_torque_forward}


def sts3215() -> Row:
    """STS3215, 30 s at 30 Hz, goals of a teleoperated joint, a pendulum; made by the engine, counts of the encoder."""
    file, rng = st.load_servo("feetech-sts3215-7v4"), np.random.default_rng(4)
    truth = _other(file, {"R": 1.12, "J": 0.8, "F": 1.15})
    time = np.arange(900) / 30.0
    knots = np.cumsum(rng.uniform(0.4, 1.2, 60))
    goals = np.interp(time, knots, rng.uniform(-1.2, 1.2, 60))
    goals = ENCODER * np.round(np.convolve(np.pad(goals, 3, mode="edge"), np.ones(7) / 7.0, "valid") / ENCODER)
    load = st.loads.Pendulum(mass=0.25, length=0.2, inertia=0.0)
    log = st.Log(name="episode", time=time, command=goals, command_kind="angle", load=load, motion="teleoperated",
                 measured={"output_angle": np.zeros(len(time))})
    phase = {"firmware.control_phase": 4e-4}  # which the fit does not know
    seen = _run(truth.replace(phase), log, 0.012)
    log = replace(log, measured={"output_angle": ENCODER * np.round(seen / ENCODER)})
    return Row([log], file, {}, _true(truth))


def of_xl330() -> Row:
    """XL330, twelve logs of BAM's, one law (M3)."""
    servo = st.load_servo("dynamixel-xl330-m288").replace({"supply.open_circuit_voltage": 7.4})
    return Row(xl330.logs(_data()), servo, {
        "free": XL330, "priors": None, "noise": xl330.NOISE, "sensors": ["output_angle"]}, {})


def of_miuzei() -> Row:
    """Miuzei 25 kg, all 58 runs."""
    return Row(st.read_logs(_data() / "miuzei_25kg" / "runs.json"), miuzei.digital("diode"), {
        "free": miuzei.DIGITAL, "priors": None, "mend": ("not followed",), "noise": miuzei.JITTER, "starts": 1}, {})


ROWS: dict[str, Callable[[], Row]] = {
    "hs755hb": hs755hb, "pendulums": pendulums, "sts3215": sts3215, "mg996r": mg996r, "xl330": of_xl330,
    "miuzei": of_miuzei}
LADDERS = {"xl330-ladder": of_xl330}


def _data() -> Path:
    if DATA is None:
        raise FileNotFoundError("the measured logs beside the repository")
    return DATA


def _fit(row: Row, **more: Any) -> st.Fit:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return st.identify(row.logs, row.servo, **row.options, **more)


def _timed(act: Callable[[], Any]) -> tuple[Any, float]:
    began = clock.process_time()
    found = act()
    return found, clock.process_time() - began


def _off(fit: st.Fit, truth: dict[str, float]) -> str:
    """Return how far estimates are off the truth [%], or what they are."""
    if truth:
        return ", ".join(f"{name.rpartition('.')[2]} {100.0 * (fit.estimates[name] / value - 1.0):+.1f} %"
                         for name, value in truth.items() if name in fit.estimates)
    return ", ".join(f"{name.rpartition('.')[2]} {value:.4g}" for name, value in fit.estimates.items())


def _warm(row: Row) -> None:
    """Compile the kernels: a short piece of one log does."""
    log = row.logs[0]
    _fit(row._replace(logs=[log.part(float(log.time[0]), float(log.time[0]) + min(1.5, log.duration))]),
         **{**FIRST, "starts": 1, "holdout": 0} if "starts" not in row.options else {**FIRST, "holdout": 0})


def measure(name: str, *, first_only: bool = False) -> None:
    """Print the lines of a row."""
    row = (ROWS | LADDERS)[name]()
    try:
        _warm(row)
    except st.errors.ServotwinError:
        pass  # a piece in which nothing moves
    if name in LADDERS:
        options = {key: value for key, value in row.options.items() if key != "free"}
        ladder, spent = _timed(lambda: st.identification.friction_ladder(
            row.logs, row.servo, free=[n for n in row.options["free"] if n in PLANT[:3]], **options))
        print(f"  {name:12} M1 to M6 {spent:8.1f} s   chosen {ladder.chosen}", flush=True)
        return
    first, early = _timed(lambda: _fit(row, **FIRST))
    print(f"  {name:12} first    {early:8.1f} s   {_rms(first):7.3f} mrad   {_off(first, row.truth)}", flush=True)
    if first_only:
        return
    fit, spent = _timed(lambda: _fit(row))
    print(f"  {name:12} default  {spent:8.1f} s   {_rms(fit):7.3f} mrad   {_off(fit, row.truth)}\n  {'':12} "
          f"{fit.verdict.sentence if fit.verdict else ''}", flush=True)


def standin(name: str) -> None:
    """Print the estimates of a search that never goes by the engine itself beside those of the engine."""
    if name not in ROWS:
        return
    row = ROWS[name]()
    fit, spent = _timed(lambda: _fit(row, diagnose=False, compare_with=()))
    exactly = Task.exactly
    Task.exactly = lambda self, point: None  # so that the last search stays with lanes that go nearly
    try:
        near, sooner = _timed(lambda: _fit(row, **FIRST))
    finally:
        Task.exactly = exactly
    print(f"  {name:12} engine with intervals {spent:.1f} s, stand-in {sooner:.1f} s; estimate of the engine, of the "
          "stand-in, and how far that is, in widths of the interval")
    for number, (lower, upper, _) in fit.intervals().items():
        one, other = fit.estimates[number], near.estimates[number]
        print(f"    {number:42} {one:12.5g} {other:12.5g} {(other - one) / (upper - lower):+8.3f}", flush=True)


def _rms(fit: st.Fit) -> float:
    """Return what is left of the fitted logs [mrad]."""
    return 1e3 * math.sqrt(np.mean(np.concatenate([t.residual for t in fit.traces if not t.held_out]) ** 2))


def main(*words: str) -> None:
    print("seconds of CPU of a first result and of a default fit; estimates, off the truth where it is known")
    names = [word for word in words if word not in ("first", "standin")] or [*ROWS, *LADDERS]
    for name in names:
        try:
            if "standin" in words:
                standin(name)
            else:
                measure(name, first_only="first" in words)
        except FileNotFoundError as missing:
            print(f"  {name:12} left out: {missing}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
