"""Options and words of `servotwin linear`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import plotting
from servotwin.errors import InputError
from servotwin.look import CURVES_A_PAGE, escape, on_page, pages
from servotwin.look.reports import Pairs, Part, Picture, Report, Section, Table
from servotwin.models import PulseServo, PulseServoInductive
from servotwin.plotting import Response
from servotwin.units.quantities import quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from servotwin.linear import SampledServo, Tuning
    from servotwin.linear.overview import Overview
    from servotwin.models import Model


# --- Options and words of `servotwin linear` --------------------------------------------------------------------------

_AMPLITUDES = ("1deg", "5deg", "20deg")
_FRAMES = ("20ms", "10ms", "5ms")
_NOT_TUNED = ("--amplitude", "--angle")
LOOP_HEAD = ("decides every", "slowest pole", "damping", "gain margin", "phase margin", "may come later by",
             "crossover")
SINE_HEAD = ("sines of", "bandwidth", "at the lowest frequency", "not a sine by", "sticks")


def asked(model: Model, amplitude: Sequence[str] | None, frame: Sequence[str] | None,
          angle: str | None) -> dict[str, Any]:
    """Return the arguments of `overview` out of the words of the options."""
    has_frames = isinstance(model, PulseServo | PulseServoInductive)
    sizes = [quantity("--amplitude", word, "angle", positive=True) for word in _split(amplitude or _AMPLITUDES)]
    frames = [quantity("--frame", word, "time", positive=True)
              for word in _split(frame or (_FRAMES if has_frames else ()))]
    own = model.frame_period if isinstance(model, PulseServo | PulseServoInductive) else math.nan
    return {"amplitudes": sizes, "frame_periods": [T for T in frames if T != own],
            "angle": None if angle is None else quantity("--angle", angle, "angle")}


def check_together(options: Mapping[str, Any], *, tune: bool) -> None:
    """Raise InputError if an option of --tune is given without it, or one that it does not read beside it.

    Parameters
    ----------
    options : mapping of str to object
        By name; None where one is not given.
    tune : bool

    Examples
    --------
    >>> check_together({"--phase-margin": "50deg", "--angle": None}, tune=True)
    """
    for option, value in options.items():
        if value is not None and (option in _NOT_TUNED) == tune:
            raise InputError(option, got=", ".join(value) if isinstance(value, list) else value,
                             allowed="without --tune, whose --step is about the middle of the travel" if tune
                             else "together with --tune")


def wanted(*, phase_margin: str | None, overshoot: str | None, step: str | None, frame: Sequence[str] | None,
           derivative: bool) -> dict[str, Any]:
    """Return the arguments of `tune` out of the words of the options.

    Raises
    ------
    InputError
        If none or both of what may be wanted are given, or several frame periods.

    Examples
    --------
    >>> wanted(phase_margin=None, overshoot="10%", step="5 deg", frame=["10ms"], derivative=False)["frame_period"]
    0.01
    """
    if (phase_margin is None) == (overshoot is None):
        raise InputError("--tune", got="both --phase-margin and --overshoot" if overshoot else "nothing to tune for",
                         allowed="--phase-margin ANGLE or --overshoot PERCENT")
    frames = _split(frame or ())
    if len(frames) > 1:
        raise InputError("--frame", got=", ".join(frames), allowed="one frame period beside --tune")
    found: dict[str, Any] = {"derivative": derivative}
    if phase_margin is not None:
        found["phase_margin"] = quantity("--phase-margin", phase_margin, "angle")
    if overshoot is not None:
        found["overshoot"] = _share(overshoot)
    if step is not None:
        found["step"] = quantity("--step", step, "angle", positive=True)
    if frames:
        found["frame_period"] = quantity("--frame", frames[0], "time", positive=True)
    return found


def _share(text: str) -> float:
    try:
        return float(text.strip().removesuffix("%")) / 100.0
    except ValueError:
        raise InputError("--overshoot", got=text, allowed="a number of per cent, such as 10%") from None


def _split(words: Sequence[str]) -> list[str]:
    return [part.strip() for word in words for part in word.split(",")]


def mean_pairs(found: Overview) -> list[tuple[str, str]]:
    """Return what the mean of the voltage gives."""
    if found.natural is None:
        return []
    omega, zeta = found.natural
    return [("mean of the voltage", f"natural frequency {omega:.3g} rad/s ({omega / (2.0 * math.pi):.3g} Hz), damping "
             f"{zeta:.2f}; friction and deadband apart")]


def loop_rows(found: Overview) -> list[list[str]]:
    """Return a row for each time between decisions: poles and margins of the sampled loop."""
    return [_loop_row(period, loop) for period, loop in found.loops.items()]


def times(gain: float) -> str:
    """Return a gain margin as people read it, in dB too.

    Examples
    --------
    >>> times(4.0)
    '4 times (12 dB)'
    """
    return f"{gain:.3g} times ({20.0 * math.log10(gain):.3g} dB)"


def _loop_row(period: float, loop: SampledServo) -> list[str]:
    margins, slowest = loop.margins, loop.poles[0]
    gain = "any" if math.isinf(margins.gain) else "none" if math.isnan(margins.gain) else times(margins.gain)
    swings = f"{slowest.real:.3g} +/- {abs(slowest.imag):.3g}i 1/s" if slowest.imag else f"{slowest.real:.3g} 1/s"
    if math.isnan(margins.phase):
        rest = ["-", "-", "-"]
    else:
        rest = [f"{math.degrees(margins.phase):.0f} deg", f"{1e3 * margins.delay:.3g} ms",
                f"{margins.crossover / (2.0 * math.pi):.3g} Hz"]
    return [f"{1e3 * period:.4g} ms", swings, f"{loop.damping:.2f}" if loop.stable else "unstable", gain, *rest]


def sine_rows(found: Overview) -> list[list[str]]:
    """Return a row for each amplitude: what simulated sines did."""
    rows = []
    for k, each in enumerate(found.sines):
        stuck = found.frequency[each.sticks] / (2.0 * math.pi)
        sticks = ("-" if each.described is None else "nowhere" if not stuck.size else "everywhere"
                  if stuck.size == len(found.frequency) else f"at {stuck.size} of {len(found.frequency)} frequencies, "
                  f"{stuck.min():.2g} to {stuck.max():.2g} Hz")
        width = each.bandwidth / (2.0 * math.pi)
        shown = "does not follow" if math.isnan(width) else "beyond all" if math.isinf(width) else f"{width:.3g} Hz"
        rest = float(found.simulated.distortion[k].max())
        rows.append([f"{math.degrees(each.amplitude):.3g} deg", shown, f"gain {found.simulated.gain[k, 0]:.3f}",
                     "no sine at all" if rest > 1.0 else f"up to {100.0 * rest:.0f} %", sticks])
    return rows


def facts(found: Overview) -> dict[str, Any]:
    """Return all of it as plain numbers in SI units."""
    margins = {period: loop.margins for period, loop in found.loops.items()}
    return {
        "servo": found.model.servo.name, "model": type(found.model).__name__, "frequency": found.frequency.tolist(),
        "mean": None if found.natural is None else {
            "natural_frequency": found.natural[0], "damping": found.natural[1], "gain": _gain(found.mean),
            "phase": _phase(found.mean)},
        "loops": [{"period": period, "stable": loop.stable, "damping": loop.damping,
                   "poles": [[pole.real, pole.imag] for pole in loop.poles.tolist()],
                   "gain_margin": margins[period].gain, "phase_margin": margins[period].phase,
                   "delay_margin": margins[period].delay, "crossover": margins[period].crossover}
                  for period, loop in found.loops.items()],
        "sines": [{"amplitude": each.amplitude, "bandwidth": each.bandwidth, "gain": found.simulated.gain[k].tolist(),
                   "phase": found.simulated.phase[k].tolist(), "distortion": found.simulated.distortion[k].tolist(),
                   "described_gain": _gain(each.described), "described_phase": _phase(each.described),
                   "sticks": each.sticks.tolist()} for k, each in enumerate(found.sines)]}


def columns(found: Overview) -> dict[str, Any]:
    """Return the columns of a table over frequency."""
    table: dict[str, Any] = {"frequency_Hz": found.frequency / (2.0 * math.pi)}

    def add(name: str, response: Any) -> None:
        if response is not None:
            table[f"{name}_gain"], table[f"{name}_phase_deg"] = np.abs(response), np.degrees(_unwrapped(response))

    add("mean", found.mean)
    for period, loop in found.loops.items():
        inside = found.frequency < loop.half_rate
        response = np.full(len(found.frequency), np.nan, np.complex128)
        response[inside] = loop.response(found.frequency[inside])
        add(f"sampled_{1e3 * period:g}ms", response)
    for k, each in enumerate(found.sines):
        name = f"{math.degrees(each.amplitude):g}deg"
        add(f"simulated_{name}", found.simulated.response[k])
        add(f"described_{name}", each.described)
    return table


def _unwrapped(response: Any) -> Any:
    """Return the phase of a response over frequency, without jumps of a whole turn [rad]; nan where it is none."""
    phase = np.angle(response)
    there = np.isfinite(phase)
    phase[there] = np.unwrap(phase[there])
    return phase


def _gain(response: Any) -> list[float] | None:
    return None if response is None else np.abs(response).tolist()


def _phase(response: Any) -> list[float] | None:
    return None if response is None else _unwrapped(response).tolist()


def tuning_pairs(found: Tuning) -> list[tuple[str, str]]:
    """Return what a gain that was found is, and does."""
    margins = found.margins
    settings = ", ".join(f"{name} = {value:.4g}" if name != "outer_gain" else
                         f"{value:.3g} of the error at the tap, added to the command in every frame"
                         for name, value in found.settings.items())
    delay = "" if math.isnan(margins.delay) else f", {1e3 * margins.delay:.3g} ms of delay"
    rows = [("gain", settings), ("stiffness", f"{found.stiffness:.3g} N m/rad of the servo itself"
                                 + (", none is lost to a load that stays" if "outer_gain" in found.settings else "")),
            ("margins", f"gain {times(margins.gain)}, {math.degrees(margins.phase):.0f} deg of phase{delay}"),
            ("step", f"{math.degrees(found.step):.4g} deg, simulated: overshoot {100.0 * found.overshoot:.1f} %")]
    if margins.phase < math.radians(_LITTLE):
        rows.append(("note", f"less than {_LITTLE:g} deg of phase margin: friction and the limit of the bridge calm a "
                     "step of this size, small motions ring"))
    return rows


_LITTLE = 30.0  # deg


def tuning_facts(found: Tuning) -> dict[str, Any]:
    """Return the same as plain numbers in SI units."""
    return {"servo": found.model.servo.name, "settings": found.settings, "stiffness": found.stiffness,
            "gain_margin": found.margins.gain, "phase_margin": found.margins.phase,
            "delay_margin": found.margins.delay, "crossover": found.margins.crossover,
            "overshoot": found.overshoot, "step": found.step}


# --- The page of a servo's linear views: HTML that needs nothing but itself -------------------------------------------

_STYLE = "figure img.drawing{width:100%;max-width:44rem}"


def by_amplitude(found: Overview, page: int = 1) -> Figure:
    """Return gain and phase of simulated sines by their amplitude, with what the linear views say.

    Every page shows the views that have no amplitude.
    """
    shown, title = on_page("amplitudes", range(len(found.sines)), CURVES_A_PAGE, page)
    drawn = []
    if found.mean is not None:
        drawn.append(Response("mean of the voltage", found.frequency, found.mean, False, 4))
    for period, loop in list(found.loops.items())[:1]:
        fine = _fine(found, loop.half_rate)
        drawn.append(Response(f"decides every {1e3 * period:.4g} ms", fine, loop.response(fine), False, 0))
    for k, number in enumerate(shown):
        each, simulated = found.sines[number], found.simulated.response[number]
        size = f"{math.degrees(each.amplitude):.3g}°"
        drawn.append(Response(f"sines of {size}, simulated", found.frequency, simulated, True, k))
        if each.described is not None and not each.sticks.all():
            free = ~each.sticks
            drawn.append(Response(f"describing functions, {size}", found.frequency[free], each.described[free], False,
                                  (k + 1) % CURVES_A_PAGE))
    return plotting.bode(drawn, title=title, height=5.2)


def by_frames(found: Overview, page: int = 1) -> Figure:
    """Return gain and phase of small sines by the time between decisions."""
    shown, title = on_page("times between decisions", list(found.loops.items()), CURVES_A_PAGE, page)
    drawn = []
    for k, (period, loop) in enumerate(shown):
        fine = _fine(found, loop.half_rate)
        drawn.append(Response(f"every {1e3 * period:.4g} ms", fine, loop.response(fine), False, k))
    return plotting.bode(drawn, title=title, height=4.2)


def _fine(found: Overview, half_rate: float) -> np.ndarray:
    most = min(float(found.frequency[-1]) * 2.0, half_rate * (1.0 - 1e-9))
    return np.geomspace(float(found.frequency[0]), most, 300)


def report(found: Overview) -> Report:
    """Return a servo's linear views in words, tables and pictures."""
    servo = found.model.servo
    parts: list[Part] = [Pairs(mean_pairs(found))] if found.natural else []
    parts += [
        Picture(lambda: [by_amplitude(found, page) for page in pages(len(found.sines), CURVES_A_PAGE)],
                "Angle over commanded angle: small signals (lines) and simulated sines of finite size (marks). The "
                "grey line is 3 dB below the command. Where friction holds the shaft for a part of the sine, no line "
                "is drawn for its describing functions."),
        Table(SINE_HEAD, sine_rows(found), "Simulated sines")]
    loops: list[Part] = [] if not found.loops else [
        Table(LOOP_HEAD, loop_rows(found), "The sampled loop, friction and deadband apart"),
        Picture(lambda: [by_frames(found, page) for page in pages(len(found.loops), CURVES_A_PAGE)],
                "Small sines by the time between decisions: shorter frames make an analog servo stiffer and faster, "
                "and less damped."),
        Picture(lambda: [plotting.root_locus(next(iter(found.loops.values())))],
                "Where the poles of the sampled loop go as its gain grows. To the right of the axis it is unstable.")]
    return Report(f"{servo.title or servo.name}: linear views",
                  f"<code>{escape(servo.name)}</code>, {escape(servo.kind)}, {type(found.model).__name__}",
                  [Section("", parts), *([Section("As it decides", loops)] if loops else [])], style=_STYLE)
