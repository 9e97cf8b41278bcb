"""The loop of a digital servo at rest, in words and as facts for JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.cli.span_words import with_span
from servotwin.datasheet.guesses import Span

if TYPE_CHECKING:
    from servotwin.datasheet import Loop, Protection

_ZERO_CELSIUS = 273.15


def loop_pairs(loop: Loop, torque: float | None = None) -> list[tuple[str, str]]:
    """Return stiffness, dead zone, friction, cap and protections as pairs of label and text.

    Parameters
    ----------
    loop : Loop
    torque : float, optional
        A load whose droop is told as well [N m].

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
    >>> loop_pairs(st.curves(model, bandwidth=False).voltages[0].loop)[0]
    ('stiffness', '32.3 N m/rad (0.564 N m/deg)')
    """
    guessed = loop.spans

    def angle(name: str) -> str:
        return _deg(getattr(loop, name), guessed.get(name))

    stiffness = (f"{with_span(loop.stiffness, guessed.get('stiffness'), '.3g', 'N m/rad')} "
                 f"({math.radians(loop.stiffness):.3g} N m/deg)")
    zone = f"{angle('dead_zone')} either way" if loop.dead_zone > 0.0 else "none"
    found = [("stiffness", stiffness), ("dead zone", zone)]
    if loop.count > 0.0:
        found.append(("sees its angle in steps of", _deg(loop.count)))
    if loop.minimum_duty > 0.0:
        found.append(("startup force", _startup(loop)))
    start = ("no error moves the free shaft" if math.isnan(loop.start_error) else
             f"an error of {angle('start_error')} moves the free shaft")
    found.append(("friction", f"{loop.friction_torque:.3g} N m: a band of {angle('friction_error')} either way; "
                              f"{start}"))
    found.append(("torque at the cap", f"{loop.cap_torque:.3g} N m of the motor, of which it lifts "
                                       f"{loop.cap_lifts:.3g}, at {_percent(loop.most_duty)} of the duty"))
    found.append(("reaches the cap at", angle("cap_error")))
    if loop.has_integral:
        found.append(("integral", "takes away in time what the load leaves of the error"))
    if torque is not None and torque >= 0.0:
        found.append((f"droop for {torque:.3g} N m", _droop(loop, torque)))
    found += [(f"trips by {each.kind}", _protection(each)) for each in loop.protections]
    return found if loop.protections else [*found, ("trips", "by nothing that is known of it")]


def _startup(loop: Loop) -> str:
    """Return the torque of the smallest duty, and that it moves the free shaft where it exceeds friction."""
    torque, friction = loop.motor_torque(loop.minimum_duty), loop.friction_torque
    span = loop.spans.get("minimum_duty")
    torques = None if span is None else Span(*map(loop.motor_torque, span))
    said = f"{_percent(loop.minimum_duty, span)} of the duty: {with_span(torque, torques, '.3g', 'N m')}"
    if not loop.startup_moves:
        return said
    return f"{said}, more than the friction of {friction:.3g} N m: every duty that is not 0 moves the free shaft"


def _droop(loop: Loop, torque: float) -> str:
    held, lifted = loop.droop(torque)
    if math.isnan(held):
        return "does not hold it"
    guessed = loop.droop_spans(torque)
    up = f"{_deg(lifted, guessed.get('lifted'))} after coming up" if not math.isnan(lifted) else "it does not come up"
    return f"{_deg(held, guessed.get('held'))} where friction helps, {up}"


def _protection(each: Protection) -> str:
    """Return what starts a protection, after how long, what is left, and what ends it."""
    if each.kind == "heat":
        return (f"above {each.threshold - _ZERO_CELSIUS:.0f} deg C of the housing: no duty until it is 5 K cooler; "
                "needs thermal numbers")
    if each.kind == "undervoltage":
        return f"below {each.threshold:.3g} V at the servo"
    after = f" over {each.time:.3g} s" if each.time > 0.0 else ""
    where = "which a fast shaft never draws" if math.isnan(each.error) else (
        f"held fast {_deg(each.error)} off, {each.torque:.3g} N m")
    if each.kind == "current":
        return f"{each.threshold:.3g} A{after} ({where}): limp until the next goal"
    left = (f"{_percent(each.left)} of the duty are left, {each.left_torque:.3g} N m" if each.left > 0.0 else "limp")
    ends = ("a power cycle" if each.latches else "torque off" if math.isnan(each.release_error) or each.left == 0.0 else
            f"the error is below {_deg(each.release_error)}")
    where = "which no error asks for" if math.isnan(each.error) else where
    return f"{_percent(each.threshold)} of the duty asked for{after} ({where}): {left}, until {ends}"


def loop_facts(loop: Loop, torque: float | None = None) -> dict[str, Any]:
    """Return the same in SI, ready for JSON."""
    found: dict[str, Any] = {name: getattr(loop, name) for name in (
        "stiffness", "dead_zone", "count", "minimum_duty", "most_duty", "has_integral", "friction_torque",
        "friction_error", "start_error", "startup_moves", "cap_error", "cap_torque", "cap_lifts")}
    if torque is not None and torque >= 0.0:
        found["droop"] = dict(zip(("held", "lifted"), loop.droop(torque), strict=True))
        found["droop_spans"] = loop.droop_spans(torque)
    return found | {"spans": loop.spans} | {"protections": [each._asdict() for each in loop.protections]}


def _deg(angle: float, span: Span | None = None) -> str:
    return with_span(math.degrees(angle), span, ".2f", "deg", scale=math.degrees(1.0))


def _percent(share: float, span: Span | None = None) -> str:
    return with_span(100.0 * share, span, ".3g", "%", scale=100.0)
