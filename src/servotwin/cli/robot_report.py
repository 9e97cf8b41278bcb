"""The files that `servotwin robot run` writes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.cli.output_files import Target, Writers, check_targets, json_of, page_name, text_of, write_files
from servotwin.cli.summary import model_name, supply_facts
from servotwin.cli.terminal import emit_json, show
from servotwin.errors import OutputError
from servotwin.look import escape
from servotwin.look.reports import Beside, Cards, Html, Report, Section, Table, notes, signs
from servotwin.parameters.output_file import undone

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray
    from rich.console import RenderableType

    from servotwin.robots import RobotRun, Sizing
    from servotwin.robots.camera import Trail
    Trails = Callable[[int], Sequence[Trail]]


# --- Facts and rows of a robot that has followed a motion: facts in SI, and rows of a table ---------------------------

HEAD = ("joint", "rms error", "at most", "late by", "peak", "supply", "winding", "margin")
_ZERO_CELSIUS = 273.15
_MOST = 100.0  # times: beyond it a margin is not stated in numbers


def run_facts(run: RobotRun, sized: dict[str, Sizing], robot: str) -> dict[str, Any]:
    """Return the facts of a run that matter, in SI, ready for JSON."""
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


# --- The files that `servotwin robot run` writes ----------------------------------------------------------------------

SERVOS, JOINTS, SUMMARY, PAGE = "run.csv", "joints.csv", "summary.json", "index.html"
TRACKING, ELECTRICAL, SIZING, PICTURE, VIDEO = (
    "tracking.png", "electrical.png", "sizing.png", "robot.png", "robot.webm")
SIZE = (640, 480)  # pixels of picture and video
_OPTION = "--out"


@contextmanager
def folder(out: Path) -> Iterator[None]:
    """Let a folder be there; one that was not and stays empty goes again.

    Raises
    ------
    OutputError
        If it cannot be made.
    """
    with ExitStack() as stack:
        try:
            if not out.exists():
                out.mkdir()
                stack.enter_context(undone(partial(_remove_if_empty, out)))
            elif not out.is_dir():
                raise OutputError(f"{_OPTION} {out} is no folder")
        except FileNotFoundError:
            raise OutputError(f"{_OPTION} {out}: the folder {out.parent} does not exist") from None
        except (OSError, ValueError) as error:
            if isinstance(error, OutputError):
                raise
            raise OutputError(f"{_OPTION} {str(out)!r} cannot be made "
                              f"({getattr(error, 'strerror', None) or error})") from None
        yield


def _remove_if_empty(path: Path) -> None:
    with suppress(OSError):
        path.rmdir()


@dataclass(frozen=True, kw_only=True)
class RobotResult:
    """The result of a command of robots: for JSON, for files, and for the terminal.

    Parameters
    ----------
    facts : dict
        Plain numbers in SI, for JSON.
    title : str
        The terminal's first line.
    lines : callable
        Returns what the terminal shows below it, with rows on the files at the end of a list of pairs.
    writers : callable
        Returns what writes the files, by their names.
    draw : callable, optional
        Writes what takes longest, as of `write_files`.
    fit : ArmFit, optional
        Of a command that fits.
    """

    facts: dict[str, Any]
    title: str
    lines: Callable[[Sequence[tuple[str, str]]], Iterable[RenderableType]]
    writers: Callable[[], Writers]
    draw: Callable[[Mapping[str, Path]], object] | None = None
    fit: Any = None


def carried_out(work: Callable[[], RobotResult], out: Path | None, names: Sequence[str], *, force: bool,
                as_json: bool, inputs: Sequence[Path] = ()) -> RobotResult:
    """Check where files go, do the work of a command, write all of its files or none, and show what it found.

    Parameters
    ----------
    work : callable
    out : Path, optional
        Folder; no files unless given.
    names : sequence of str
        Of the files; the last is shown.
    force : bool
        Whether files that are there may be replaced.
    as_json : bool
    inputs : sequence of Path
        Files that are read, and may not be written.

    Raises
    ------
    OutputExistsError, OutputError
        As `check_targets` does.
    """
    with folder(out) if out is not None else nullcontext():
        targets = [] if out is None else [
            Target(option=_OPTION, path=out / name, endings=(Path(name).suffix,)) for name in names]
        check_targets(targets, force=force, inputs=inputs)
        result = work()
        if targets:
            write_files(targets, result.writers(), force=force, draw=result.draw)
    written = result.facts["files"] = [str(target.path) for target in targets]
    if as_json:
        emit_json(result.facts)
    else:
        show(result.title, *result.lines([("written", written[-1])] if written else []))
    return result


def run_names(servos: int, *, picture: bool, video: bool) -> list[str]:
    """Return the names of the files of a motion that so many servos have followed."""
    return [SERVOS, JOINTS, SUMMARY, *servo_pictures(servos), *drawn_names(picture=picture, video=video), PAGE]


def servo_pictures(servos: int) -> list[str]:
    """Return the names of the pictures of what so many servos have done, all pages of each."""
    return [name for picture in (TRACKING, ELECTRICAL, SIZING) for name in joint_pages(picture, servos)]


def joint_pages(picture: str, joints: int) -> list[str]:
    """Return the names of the pages on which a picture shows so many joints."""
    from servotwin.plotting import JOINTS_A_PAGE, pages

    return [page_name(picture, page) for page in pages(joints, JOINTS_A_PAGE)]


def drawn_names(*, picture: bool, video: bool) -> list[str]:
    """Return the names of what is drawn of the robot."""
    return [*([PICTURE] if picture else []), *([VIDEO] if video else [])]


def run_writers(run: RobotRun, sized: Mapping[str, Sizing], names: Sequence[str], found: Mapping[str, Any],
                output_step: float, sections: Sequence[Section] = (), still: int | None = None) -> Writers:
    """Return what writes the files of a run that are not drawn of the robot.

    Parameters
    ----------
    run : RobotRun
    sized : mapping of str to Sizing
    names : sequence of str
        Of all files.
    found : mapping
        Facts that `run_facts` gives of the run.
    output_step : float
        Between the rows of tables [s]
    sections : sequence of Section
        Of the page, on further files.
    still : int, optional
        Row that the picture is of; that of the largest error unless given.
    """
    when = "At the time of the largest error." if still is None else f"At {run.time[still]:.2f} s."
    return {SERVOS: lambda path: run.record.save(path, every=every(run.time, output_step)),
            JOINTS: text_of(lambda: _joint_table(run, output_step)), SUMMARY: json_of(found),
            PAGE: text_of(lambda: page(run, sized, found, names, sections, when)), **_pictures(run, sized)}


def every(time: NDArray[np.float64], step: float) -> int:
    """Return every how many-th of evenly spaced times, shape (n,) [s], is a row of a table with a step [s]."""
    return max(round(step / float(time[1] - time[0])), 1)


def _joint_table(run: RobotRun, output_step: float) -> str:
    """Return goal, real and ideal place of all joints, and what the motion takes of them, as CSV."""
    from servotwin.tables import csv_text
    from servotwin.units import from_si

    rows, columns = every(run.time, output_step), {"time_s": run.time}
    for joint in run.mounts:
        slides = run.slides(joint)
        unit, dimension = ("mm", "length") if slides else ("deg", "angle")
        places: dict[str, NDArray[np.float64]] = {
            "goal": run.goal(joint), "place" if slides else "angle": run.record[joint]["joint_angle"],
            "ideal": run.ideal.courses[joint].angle}
        if (measured := run.measured(joint)) is not None:
            places["measured"] = measured
        for name, values in places.items():
            columns[f"{joint}.{name}_{unit}"] = np.asarray(from_si(values, unit, dimension))
        columns[f"{joint}.needed_{'force_N' if slides else 'torque_Nm'}"] = run.ideal.torque[joint]
        columns[f"{joint}.delivered_{'force_N' if slides else 'torque_Nm'}"] = run.record[joint]["joint_torque"]
    return csv_text({name: (values[::rows] + 0.0).tolist() for name, values in columns.items()}, digits=9)


def _pictures(run: RobotRun, sized: Mapping[str, Sizing]) -> dict[str, Callable[[Path], object]]:
    from servotwin import plotting

    record = run.record
    followed = [plotting.JointTrace(
        joint, run.time, run.goal(joint), record[joint]["joint_angle"], run.ideal.courses[joint].angle,
        run.slides(joint), run.measured(joint)) for joint in run.mounts]
    drawn = [plotting.ServoTrace(joint, run.time, record[joint]["armature_current"], *(
        record[joint].get(name) for name in ("bus_voltage", "winding_temperature", "housing_temperature")))
        for joint in run.mounts]
    inside = (run.time >= 0.0) & (run.time <= run.motion.duration)
    shafts = [_shaft(each, inside) for each in sized.values()]
    pictures: dict[str, Callable[[int], Figure]] = {
        TRACKING: lambda page: plotting.joint_tracking(followed, events=(0.0, run.motion.duration), page=page),
        ELECTRICAL: lambda page: plotting.servo_electrics(drawn, page=page),
        SIZING: lambda page: plotting.shaft_torques(shafts, page=page),
    }
    return {name: partial(_save, draw, page) for picture, draw in pictures.items()
            for page, name in enumerate(joint_pages(picture, len(run.mounts)), 1)}


def _save(draw: Callable[[int], Figure], page: int, path: Path) -> None:
    """Write a page of a picture into a file."""
    from servotwin import plotting

    plotting.save(draw(page), path)


def _shaft(sized: Sizing, inside: Any) -> Any:
    from servotwin import plotting

    curves = [(f"alone on {sized.voltage:g} V", sized.curve)]
    if sized.sagged is not None:
        curves.append(("with what the others leave", sized.sagged))
    needed, delivered = (plotting.Cloud(each.speed[inside], each.torque[inside])
                         for each in (sized.needed, sized.delivered))
    worst = None if math.isinf(sized.margin) else (sized.worst.speed, sized.worst.torque)
    return plotting.ShaftTrace(sized.joint, f"{margin_words(sized.margin)}×", curves, needed, delivered, worst,
                               sized.rms_torque, sized.lasting_torque)


def draw_run(places: Mapping[str, Path], run: RobotRun, camera: str | None, rate: float,
             trails: Trails = lambda k: (), still: int | None = None) -> None:
    """Draw the robot where it is furthest off, or at a row, and all of it as a video of a rate [Hz].

    `trails` returns the lines that are drawn at a row; nothing is drawn where there is no place for a picture.
    """
    from servotwin.robots.camera import Camera

    if PICTURE not in places:
        return
    errors = np.max([np.abs(run.goal(joint) - run.record[joint]["joint_angle"]) for joint in run.mounts], axis=0)
    inside = np.flatnonzero((run.time >= 0.0) & (run.time <= run.motion.duration))

    with Camera(run.model, *SIZE, camera, run.poses) as view:
        def drawn(k: int) -> Any:
            return view.picture(run.poses[k], run.ideal.poses[k], words=f"{max(run.time[k], 0.0):.2f} s",
                                note="pale: with ideal actuators", trails=trails(k))

        worst = int(inside[np.argmax(errors[inside])])
        picture_and_video(drawn, run.time, worst if still is None else still, places, rate)


def picture_and_video(drawn: Callable[[int], Any], time: NDArray[np.float64], still: int, places: Mapping[str, Path],
                      rate: float) -> None:
    """Write one picture, and all as a video if there is a place for one.

    Parameters
    ----------
    drawn : callable
        Returns the picture of a row.
    time : ndarray, shape (n,)
        Of the rows [s]
    still : int
        Which row the picture is of.
    places : mapping of str to Path
        Of both, by name.
    rate : float
        [Hz]
    """
    from servotwin.robots.camera import Video, png
    from servotwin.simulation.progress import shown

    places[PICTURE].write_bytes(png(drawn(still)))
    if VIDEO not in places:
        return
    times = np.arange(0.0, time[-1], 1.0 / rate)
    frames = np.minimum(np.searchsorted(time, times), len(time) - 1).tolist()
    with Video(places[VIDEO], *SIZE, rate) as written, shown(True, len(frames), "drawing the video") as tell:
        for done, k in enumerate(frames):
            written.add(drawn(k))
            tell(done + 1)


# --- The page of a robot that has followed a motion: HTML beside its pictures and its video ---------------------------

STYLE = """
figure img,figure video{width:100%;height:auto}figure.film{max-width:44rem}
.joints :is(td,th):nth-child(n+2):not(:last-child){text-align:right;font-variant-numeric:tabular-nums}
.joints td:nth-child(n+2):not(:last-child){white-space:nowrap}
.yes{border-left:4px solid #009e73;background:#f0faf6}.yes,.no{padding:.5rem .9rem;margin:1rem 0}
.no{border-left:4px solid #d55e00;background:#fff6ef}
"""


def page(run: RobotRun, sized: Mapping[str, Sizing], found: Mapping[str, Any], files: Sequence[str],
         sections: Sequence[Section] = (), when: str = "") -> str:
    """Return the page of a run, with sections of its own; pictures and video stand beside it, those of `files`."""
    motion_name = Path(run.motion.source).name
    title, count = f"{found['robot']}: {motion_name}", len(run.mounts)
    servos = sorted({f"{mount.model.servo.title or mount.model.servo.name} ({type(mount.model).__name__})"
                     for mount in run.mounts.values()})
    lead = (f"{len(run.mounts)} servo{'s' * (len(run.mounts) != 1)} ({'; '.join(servos)}) follow "
            f"{run.motion.source}, {run.motion.duration:.4g} s{_supply_words(run)}.")
    measured = ", and the measured joint" if run.motion.measured else ""
    return Report(title, escape(lead), [
        Section("", [Html(_answer(sized)), Html(notes([signs(text) for text in run.notes])), _cards(run, sized),
                     Html(film(files, when))]),
        *sections,
        Section("Is the servo big enough", [_sizes(sized), Beside(
            joint_pages(SIZING, count), "Torque over speed of each servo: what the motion takes, rotor and gear "
            "included, and what the servo gave, as means over 20 ms, in its curve at full drive. Filled: the servo "
            "drives the motion; open: it holds it back. The number is the margin.")]),
        Section("Following the motion", [_tracking(run), Beside(
            joint_pages(TRACKING, count), f"Goal, servo and ideal actuator{measured}. Dashed lines: the motion begins "
            "and ends; before and after it the robot holds its goal.")]),
        Section("Currents, supply, temperatures", [Beside(
            joint_pages(ELECTRICAL, count), "Motor current as its mean and, pale, all between the smallest and the "
            f"largest; voltage at the servo; temperatures.{_heat_words(run)}")]),
        Section("How to read this page", [Html(_READING)])], style=STYLE).page


def _supply_words(run: RobotRun) -> str:
    if run.bus is None:
        return ", each on its own supply"
    R = run.bus.internal_resistance
    return f", all on {run.bus.open_circuit_voltage:g} V" + (f" behind {R:g} Ω" if R else "")


def _answer(sized: Mapping[str, Sizing]) -> str:
    unjudged = next((each.unjudged for each in sized.values() if each.unjudged), "")
    if unjudged:
        return f'<div class="no"><p>The servos are not judged: {escape(signs(unjudged))}.</p></div>\n'
    wrong = [each for each in sized.values() if not each.big_enough]
    if not wrong:
        return '<div class="yes"><p>All servos are big enough for this motion.</p></div>\n'
    said = "".join(f"<li><b>{escape(each.joint)}</b>: {escape(signs(each.verdict))}</li>" for each in wrong)
    return f'<div class="no"><p>Not all servos are big enough:</p><ul>{said}</ul></div>\n'


def _cards(run: RobotRun, sized: Mapping[str, Sizing]) -> Cards:
    least = min(sized.values(), key=lambda each: each.margin)
    furthest = max(run.tracking, key=lambda joint: (not run.slides(joint), run.tracking[joint].rms))
    shown = [(margin_words(least.margin), f"least margin, {least.joint}"),
             (place(run.tracking[furthest].rms, run.slides(furthest)), f"error, rms, {furthest}")]
    currents = {joint: found.peak_current for joint, found in run.tracking.items()}
    most = max(currents, key=lambda joint: currents[joint])
    shown.append((f"{currents[most]:.2f} A", f"peak motor current, {most}"))
    volts = [found.lowest_voltage for found in run.tracking.values() if not math.isnan(found.lowest_voltage)]
    if volts:
        shown.append((f"{min(volts):.2f} V", "lowest supply voltage"))
    warm = {joint: found.winding for joint, found in run.tracking.items() if not math.isnan(found.winding)}
    if warm:
        hottest = max(warm, key=lambda joint: warm[joint])
        shown.append((celsius(warm[hottest]), f"hottest winding, {hottest}"))
    return Cards(shown)


def film(files: Sequence[str], when: str = "") -> str:
    """Return the video of a robot, or its picture and when that is, if there is one among the files."""
    words = "The robot; pale: the same with ideal actuators."
    if "robot.webm" in files:
        return (f'<figure class="film"><video controls loop muted poster="robot.png" src="robot.webm"></video>'
                f"<figcaption>{words}</figcaption></figure>\n")
    if "robot.png" in files:
        return Beside(["robot.png"], f"{words} {when}", "film").html
    return ""


def _sizes(sized: Mapping[str, Sizing]) -> Table:
    head = ["joint", "margin", "at", "needs", "has", "speed", "needs, rms", "lifts without end", "repeated: winding",
            "verdict"]
    rows = []
    for each in sized.values():
        worst, heat = each.worst, each.heating
        rows.append([
            each.joint, margin_words(each.margin), f"{worst.time:.2f} s", f"{worst.torque:.3g} N m",
            f"{worst.available:.3g} N m", f"{math.degrees(worst.speed):.0f}°/s", f"{each.rms_torque:.3g} N m",
            _or_dash(each.lasting_torque, "{:.3g} N m"), "–" if heat is None else celsius(heat.winding), each.verdict])
    return Table(head, rows, text_columns=len(head), kind="joints")


def _tracking(run: RobotRun) -> Table:
    measured = bool(run.motion.measured)
    head = ["joint", "servo", *(["off the measured joint, rms"] if measured else []), "error, rms", "largest",
            "late by", "error left", "stands off before", "after",
            "current, peak", "mean", "lowest voltage"]
    rows = []
    for joint, found in run.tracking.items():
        slides = run.slides(joint)
        rows.append([
            joint, run.mounts[joint].model.servo.name,
            *([place(run.measured_error(joint), slides) or "–"] if measured else []),
            *(place(value, slides) for value in (found.rms, found.largest)),
            _or_dash(1e3 * found.delay, "{:.0f} ms"),
            *(place(value, slides) or "–" for value in (found.rms_delayed, found.droop_before, found.droop_after)),
            f"{found.peak_current:.2f} A", f"{found.mean_current:.3f} A", _or_dash(found.lowest_voltage, "{:.2f} V")])
    return Table(head, rows, text_columns=len(head), kind="joints")


def _or_dash(value: float, form: str) -> str:
    return "–" if math.isnan(value) else form.format(value)


def _heat_words(run: RobotRun) -> str:
    assumed = [joint for joint in run.mounts if heat_is_assumed(run, joint)]
    if not assumed:
        return ""
    which = "all servos" if len(assumed) == len(run.mounts) else ", ".join(assumed)
    return f" Thermal numbers of {which} are assumed by their mass."


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
