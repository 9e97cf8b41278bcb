"""The page of a robot that has followed a motion: HTML beside its pictures and its video."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin.cli.robot_facts import celsius, heat_is_assumed, margin_words, place
from servotwin.cli.robot_files import ELECTRICAL, SIZING, TRACKING, joint_pages
from servotwin.look import document, escape, table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from servotwin.robots import RobotRun, Sizing

STYLE = """
figure img,figure video{width:100%;height:auto}figure.film{max-width:44rem}
.joints :is(td,th):nth-child(n+2):not(:last-child){text-align:right;font-variant-numeric:tabular-nums}
.joints td:nth-child(n+2):not(:last-child){white-space:nowrap}
.yes{border-left:4px solid #009e73;background:#f0faf6}.yes,.no{padding:.5rem .9rem;margin:1rem 0}
.no{border-left:4px solid #d55e00;background:#fff6ef}
"""


def page(run: RobotRun, sized: Mapping[str, Sizing], found: Mapping[str, Any], files: Sequence[str],
         section: str = "", when: str = "") -> str:
    """Return the page of a run, with a section of its own; pictures and video stand beside it, those of `files`."""
    title, count = f"{found['robot']}: {_motion_name(run)}", len(run.mounts)
    servos = sorted({f"{mount.model.servo.title or mount.model.servo.name} ({type(mount.model).__name__})"
                     for mount in run.mounts.values()})
    lead = (f"{len(run.mounts)} servo{'s' * (len(run.mounts) != 1)} ({'; '.join(servos)}) follow "
            f"{run.motion.source}, {run.motion.duration:.4g} s{_supply_words(run)}.")
    body = (f'<h1>{escape(title)}</h1>\n<p class="lead">{escape(lead)}</p>\n{_answer(sized)}{_notes(run)}'
            f"{_cards(run, sized)}{film(files, when)}{section}<h2>Is the servo big enough</h2>\n{_sizes(run, sized)}"
            + figures(joint_pages(SIZING, count), "Torque over speed of each servo: what the motion takes, rotor and "
                      "gear included, and what the servo gave, as means over 20 ms, in its curve at full drive. "
                      "Filled: the servo drives the motion; open: it holds it back. The number is the margin.")
            + f"<h2>Following the motion</h2>\n{_tracking(run)}"
            + figures(joint_pages(TRACKING, count), "Goal, servo and ideal actuator"
                      f"{', and the measured joint' if run.motion.measured else ''}. Dashed lines: the motion "
                      "begins and ends; before and after it the robot holds its goal.")
            + "<h2>Currents, supply, temperatures</h2>\n"
            + figures(joint_pages(ELECTRICAL, count), "Motor current as its mean and, pale, all between the smallest "
                      f"and the largest; voltage at the servo; temperatures.{_heat_words(run)}")
            + f"<section><h2>How to read this page</h2>{_READING}</section>\n")
    return document(title, body, style=STYLE)


def _motion_name(run: RobotRun) -> str:
    return Path(run.motion.source).name


def _supply_words(run: RobotRun) -> str:
    if run.bus is None:
        return ", each on its own supply"
    R = run.bus.internal_resistance
    return f", all on {run.bus.open_circuit_voltage:g} V" + (f" behind {R:g} Ω" if R else "")


def _notes(run: RobotRun) -> str:
    said = "".join(f"<li>{escape(signed(text))}</li>" for text in run.notes)
    return f'<div class="note"><ul>{said}</ul></div>\n' if said else ""


def _answer(sized: Mapping[str, Sizing]) -> str:
    unjudged = next((each.unjudged for each in sized.values() if each.unjudged), "")
    if unjudged:
        return f'<div class="no"><p>The servos are not judged: {escape(signed(unjudged))}.</p></div>\n'
    wrong = [each for each in sized.values() if not each.big_enough]
    if not wrong:
        return '<div class="yes"><p>All servos are big enough for this motion.</p></div>\n'
    said = "".join(f"<li><b>{escape(each.joint)}</b>: {escape(signed(each.verdict))}</li>" for each in wrong)
    return f'<div class="no"><p>Not all servos are big enough:</p><ul>{said}</ul></div>\n'


def _cards(run: RobotRun, sized: Mapping[str, Sizing]) -> str:
    least = min(sized.values(), key=lambda each: each.margin)
    furthest = max(run.tracking, key=lambda joint: (not run.slides(joint), run.tracking[joint].rms))
    shown = [(margin_words(least.margin), f"least margin, {least.joint}"),
             (signed(place(run.tracking[furthest].rms, run.slides(furthest))), f"error, rms, {furthest}")]
    currents = {joint: found.peak_current for joint, found in run.tracking.items()}
    most = max(currents, key=lambda joint: currents[joint])
    shown.append((f"{currents[most]:.2f} A", f"peak motor current, {most}"))
    volts = [found.lowest_voltage for found in run.tracking.values() if not math.isnan(found.lowest_voltage)]
    if volts:
        shown.append((f"{min(volts):.2f} V", "lowest supply voltage"))
    warm = {joint: found.winding for joint, found in run.tracking.items() if not math.isnan(found.winding)}
    if warm:
        hottest = max(warm, key=lambda joint: warm[joint])
        shown.append((signed(celsius(warm[hottest])), f"hottest winding, {hottest}"))
    return '<ul class="numbers">' + "".join(
        f"<li><b>{escape(value)}</b>{escape(words)}</li>" for value, words in shown) + "</ul>\n"


def film(files: Sequence[str], when: str = "") -> str:
    """Return the video of a robot, or its picture and when that is, if there is one among the files."""
    words = "The robot; pale: the same with ideal actuators."
    if "robot.webm" in files:
        return (f'<figure class="film"><video controls loop muted poster="robot.png" src="robot.webm"></video>'
                f"<figcaption>{words}</figcaption></figure>\n")
    if "robot.png" in files:
        return figure("robot.png", f"{words} {when}", kind="film")
    return ""


def figure(name: str, words: str, *, kind: str = "wide") -> str:
    """Return a picture with words below it."""
    return figures([name], words, kind=kind)


def figures(names: Sequence[str], words: str, *, kind: str = "wide") -> str:
    """Return the pages of a picture, one below the other, with words below them."""
    drawn = "".join(f'<img src="{name}" alt="{escape(words)}">' for name in names)
    return f'<figure class="{kind}"><div>{drawn}</div><figcaption>{escape(words)}</figcaption></figure>\n'


def _sizes(run: RobotRun, sized: Mapping[str, Sizing]) -> str:
    head = ["joint", "margin", "at", "needs", "has", "speed", "needs, rms", "lifts without end", "repeated: winding",
            "verdict"]
    rows = []
    for each in sized.values():
        worst, heat = each.worst, each.heating
        rows.append([
            each.joint, margin_words(each.margin), f"{worst.time:.2f} s", f"{worst.torque:.3g} N m",
            f"{worst.available:.3g} N m", f"{math.degrees(worst.speed):.0f}°/s", f"{each.rms_torque:.3g} N m",
            _or_dash(each.lasting_torque, "{:.3g} N m"), "–" if heat is None else signed(celsius(heat.winding)),
            signed(each.verdict)])
    drawn = table(head, [[escape(cell) for cell in row] for row in rows], text_columns=len(head))
    return f'<div class="joints">{drawn}</div>\n'


def _tracking(run: RobotRun) -> str:
    measured = bool(run.motion.measured)
    head = ["joint", "servo", *(["off the measured joint, rms"] if measured else []), "error, rms", "largest",
            "late by", "error left", "stands off before", "after",
            "current, peak", "mean", "lowest voltage"]
    rows = []
    for joint, found in run.tracking.items():
        slides = run.slides(joint)
        rows.append([
            joint, run.mounts[joint].model.servo.name,
            *([signed(place(run.measured_error(joint), slides)) or "–"] if measured else []),
            *(signed(place(value, slides)) for value in (found.rms, found.largest)),
            _or_dash(1e3 * found.delay, "{:.0f} ms"),
            *(signed(place(value, slides)) or "–" for value in (
                found.rms_delayed, found.droop_before, found.droop_after)),
            f"{found.peak_current:.2f} A", f"{found.mean_current:.3f} A", _or_dash(found.lowest_voltage, "{:.2f} V")])
    drawn = table(head, [[escape(cell) for cell in row] for row in rows], text_columns=len(head))
    return f'<div class="joints">{drawn}</div>\n'


def _or_dash(value: float, form: str) -> str:
    return "–" if math.isnan(value) else form.format(value)


def _heat_words(run: RobotRun) -> str:
    assumed = [joint for joint in run.mounts if heat_is_assumed(run, joint)]
    if not assumed:
        return ""
    which = "all servos" if len(assumed) == len(run.mounts) else ", ".join(assumed)
    return f" Thermal numbers of {which} are assumed by their mass."


def signed(text: str) -> str:
    """Return a text of the terminal with the signs that a page can show."""
    return text.replace(" deg C", " °C").replace("deg/s", "°/s").replace(" deg", "°").replace("-", "−")


_READING = """<ul>
<li><b>Ideal actuator.</b> The joint is exactly where the motion wants it; corners of the motion are rounded by short
parabolas. The torque that this takes is that of inverse dynamics, with rotor and gear of the servo.</li>
<li><b>Margin.</b> Torque of the servo at the speed that is needed, over the torque that is needed, where this is
least. Below 1 the servo comes late, or gives way. Where it holds a motion back its torque at rest counts.</li>
<li><b>On a shared supply</b> a servo has what the others leave of the voltage, at the worst time of the run.</li>
<li><b>Lifts without end.</b> The torque that the servo can lift slowly while its winding comes to 130 °C; to hold
still takes less, for friction helps.</li>
<li><b>Repeated.</b> The temperature to which the winding comes if the motion goes on for ever.</li>
<li><b>Late by.</b> The delay by which the goal fits the joint best; <b>error left</b> is what that does not
explain.</li>
<li><b>Stands off.</b> Goal less joint at rest, before the motion and after it.</li>
<li><b>Files.</b> <a href="run.csv">run.csv</a>: all signals of the servos; <a href="joints.csv">joints.csv</a>: goals,
joints and torques; <a href="summary.json">summary.json</a>: all numbers of this page, in SI units.</li></ul>
"""
