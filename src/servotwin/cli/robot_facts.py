"""What is told of a robot that has followed a motion: facts in SI, and rows of a table."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from servotwin.cli.summary import model_name, supply_facts

if TYPE_CHECKING:
    from servotwin.robots import RobotRun, Sizing

HEAD = ("joint", "rms error", "at most", "late by", "peak", "supply", "winding", "margin")
_ZERO_CELSIUS = 273.15
_MOST = 100.0  # times: beyond it a margin is not told in numbers


def facts(run: RobotRun, sized: dict[str, Sizing], robot: str) -> dict[str, Any]:
    """Return what is worth knowing of a run, in SI, ready for JSON."""
    return {
        "robot": robot, "motion": run.motion.source, "duration": run.motion.duration,
        "timestep": float(run.model.opt.timestep), "blend_window": run.ideal.window,
        "supply": None if run.bus is None else {
            "open_circuit_voltage": run.bus.open_circuit_voltage, "internal_resistance": run.bus.internal_resistance},
        "judged": not run.unjudged, "reason": run.unjudged or None,
        "supplies": [{"joints": list(joints), **supply_facts(sag)} for joints, _, sag in run.sags],
        "big_enough": None if run.unjudged else all(each.big_enough for each in sized.values()),
        "notes": list(run.notes),
        "joints": {joint: _of_joint(run, sized[joint]) for joint in run.mounts},
    }


def _of_joint(run: RobotRun, sized: Sizing) -> dict[str, Any]:
    mount, tracking, heat = run.mounts[sized.joint], run.tracking[sized.joint], sized.heating
    shown = dataclasses.asdict(tracking)
    shown["remarks"] = [remark.facts for remark in tracking.remarks]
    return {
        "servo": mount.model.servo.name, "model": model_name(mount.model),
        "mount": {"zero": mount.zero, "direction": mount.direction, "ratio": mount.ratio},
        "slides": run.slides(sized.joint), "tracking": shown, "measured_rms": run.measured_error(sized.joint),
        "sizing": {
            "judged": not sized.unjudged, "big_enough": None if sized.unjudged else sized.big_enough,
            "verdict": sized.verdict, "margin": sized.margin, "short": sized.short,
            "worst": sized.worst._asdict(), "supply_voltage": sized.voltage, "left_voltage": sized.left_voltage,
            "stall_torque": sized.curve.stall_torque, "top_speed": sized.top_speed, "rms_torque": sized.rms_torque,
            "rms_delivered": sized.rms_delivered, "lasting_torque": sized.lasting_torque,
            "heating": None if heat is None else {
                "heat": heat.heat, "winding": heat.winding, "housing": heat.housing, "limit_time": heat.limit_time,
                "trip_time": heat.trip_time, "thermal_masses_assumed": heat_is_assumed(run, sized.joint)},
        },
    }


def heat_is_assumed(run: RobotRun, joint: str) -> bool:
    """Tell whether the thermal masses of a servo follow from its mass alone."""
    servo = run.mounts[joint].model.servo
    return servo.thermal.winding_capacity is None or servo.source("thermal.winding_capacity").origin == "assumed"


def row(run: RobotRun, sized: Sizing) -> tuple[str, ...]:
    """Return what a table says of a joint, below `HEAD`: narrow enough for 80 columns."""
    found, slides = run.tracking[sized.joint], run.slides(sized.joint)
    return (sized.joint, place(found.rms, slides), place(found.largest, slides),
            "" if math.isnan(found.delay) else f"{1e3 * found.delay:.0f} ms", f"{found.peak_current:.2f} A",
            "" if math.isnan(found.lowest_voltage) else f"{found.lowest_voltage:.1f} V", celsius(found.winding, 0),
            margin_words(sized.margin))


def place(value: float, slides: bool) -> str:
    """Return an angle [rad] in degrees, or a length [m] in millimetres.

    Examples
    --------
    >>> place(0.1, False), place(0.0123, True), place(float("nan"), False)
    ('5.73 deg', '12.30 mm', '')
    """
    if math.isnan(value):
        return ""
    return f"{1e3 * value:z.2f} mm" if slides else f"{math.degrees(value):z.2f} deg"


def celsius(temperature: float, places: int = 1) -> str:
    """Return a temperature [K] in degrees Celsius; nothing where it is not known.

    Examples
    --------
    >>> celsius(298.15), celsius(300.0, 0), celsius(float("nan"))
    ('25.0 deg C', '27 deg C', '')
    """
    return "" if math.isnan(temperature) else f"{temperature - _ZERO_CELSIUS:.{places}f} deg C"


def margin_words(margin: float) -> str:
    """Return how many times what is needed a servo has.

    Examples
    --------
    >>> margin_words(1.834), margin_words(0.0), margin_words(12.3), margin_words(float("inf"))
    ('1.8', '0', '12', '> 100')
    """
    return f"> {_MOST:g}" if margin > _MOST else f"{margin:.2g}"
