"""The report as one HTML page that needs nothing but itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from servotwin import __version__, plotting
from servotwin.errors import MissingExtraError
from servotwin.look import document, escape, fixed, number, picture, table, untagged
from servotwin.models import PulseServo
from servotwin.paper import linear_views, tables
from servotwin.paper.figures import Drawing, Picture
from servotwin.paper.reproduction import (
    CIRCUITS,
    LABELS,
    LOAD_INERTIA,
    LOOKED_AT,
    SERVO,
    SHOWN_ROW,
    SOFT,
    BenchStudy,
    PaperStudy,
)
from servotwin.paper.tables import corrections, disagreements
from servotwin.parameters import load_servo
from servotwin.plotting import Curve, Limit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from servotwin.paper.reproduction import Stand
    from servotwin.parameters import Servo
    from servotwin.robots import TaskRun, WaypointRun
    Array = NDArray[np.float64]
    Images = Mapping[str, Drawing]


# --- The robots of Figures 28 to 30, each at one short task: pictures, tables and words for the report ----------------

FIGURES = "<!-- figures -->"
_SIZE, _SPEED = 0.04, 0.12  # m and m/s: a small circle, so that it is short
_ROUTE = ((0.0, 0.0), (0.35, 0.0), (0.35, 0.35))  # m
_COUNTS = 512  # of an encoder on a wheel
_ARMS = {"figure-28": "Figure 28: redundant SCARA robot", "figure-29": "Figure 29: SCARA robot"}
_CONTROLLERS = {"plain": "plain commands", "feedforward": "(40) as feedforward"}


@dataclass(frozen=True, kw_only=True)
class Robots:
    """The tasks of the three robots.

    Parameters
    ----------
    arms : mapping of str to mapping of str to TaskRun
        By the name of the figure and that of the controller.
    torques : mapping of str to float
        Largest torque that the circle takes of a vertical joint of the redundant arm, by criterion [N m].
    drives : mapping of str to WaypointRun
        Of the mobile robot: on equal servos, and on unequal ones with and without encoders.
    """

    arms: Mapping[str, Mapping[str, TaskRun]]
    torques: Mapping[str, float]
    drives: Mapping[str, WaypointRun]


@dataclass(frozen=True, kw_only=True)
class RobotsPart:
    """The robots of the report: pictures, tables and words, headline numbers, and why they are left out."""

    drawings: tuple[Drawing, ...]
    words: str  # HTML; FIGURES where the pictures belong
    headline: Mapping[str, float]
    left_out: str


def robots_part(formats: Sequence[str]) -> RobotsPart:
    """Let the robots do their tasks, and draw what they did."""
    robots = run_robots(load_servo(SERVO))
    return RobotsPart(drawings=tuple(picture.drawn(formats) for picture in robot_pictures(robots)),
                      words=robot_section(robots), headline=headline(robots),
                      left_out=robots if isinstance(robots, str) else "")


def run_robots(servo: Servo) -> Robots | str:
    """Let the three robots do their tasks; where an extra is missing, return what to say."""
    try:
        return _done(servo)
    except MissingExtraError as error:
        return str(error)


def _done(servo: Servo) -> Robots:
    from servotwin.robots import (
        LeastMotion,
        LeastTorque,
        follow,
        ideal_task,
        run_task,
        run_waypoints,
        scara,
        task_path,
        unequal_servos,
    )
    from servotwin.robots.arms.controllers import STEERINGS

    model, arms = PulseServo(servo), {}
    for name, third_link in (("figure-28", True), ("figure-29", False)):
        arm = scara(third_link=third_link)
        joints = follow(arm, task_path(arm, "circle", size=_SIZE, speed=_SPEED))
        arms[name] = {controller: run_task(arm, model, joints.path, steering=STEERINGS[controller](),
                                           joint_path=joints) for controller in _CONTROLLERS}
    arm = arms["figure-28"]["plain"].arm
    path, torques = task_path(arm, "circle", size=_SIZE, speed=_SPEED), {}
    for criterion in (LeastMotion(), LeastTorque()):
        taken = ideal_task(criterion.solve(arm, path)).torque
        torques[criterion.name] = float(max(np.abs(taken[joint]).max() for joint in ("shoulder", "elbow", "third")))
    worn = unequal_servos()
    drives = {"equal servos, odometry of pulses": run_waypoints(waypoints=_ROUTE),
              "unequal servos, odometry of pulses": run_waypoints(worn, _ROUTE),
              "unequal servos, encoders": run_waypoints(worn, _ROUTE, encoders=_COUNTS)}
    return Robots(arms=arms, torques=torques, drives=drives)


def robot_pictures(robots: Robots | str) -> tuple[Picture, ...]:
    """Return the pictures of the robots' ways; none where an extra is missing."""
    if isinstance(robots, str):
        return ()
    drives = [plotting.PathTrace(words, run.path, run.believed) for words, run in robots.drives.items()]
    columns = {f"{name}_{axis}_m": side[:, k].tolist()
               for words, run in zip(("equal", "unequal", "encoders"), robots.drives.values(), strict=True)
               for name, side in ((words, run.path), (f"{words}_believed", run.believed))
               for k, axis in enumerate("xy")}
    longest = max(len(column) for column in columns.values())
    padded = {name: column + [math.nan] * (longest - len(column)) for name, column in columns.items()}
    return (*(_arm(name, title, robots.arms[name]) for name, title in _ARMS.items()),
            Picture(name="figure-30", title="Figure 30: mobile robot", columns=padded,
                    caption="The paper's Figure 30 is a photograph of its mobile robot. Here one drives along three "
                    "points on two HS-755HB that turn endlessly.", figure=plotting.robot_paths(drives, _ROUTE)))


def _arm(name: str, title: str, runs: Mapping[str, TaskRun]) -> Picture:
    traces: list[plotting.ToolTrace] = []
    columns: dict[str, list[float]] = {}
    for controller, run in runs.items():
        time, places = run.run.time[run.moving], run.tool[run.moving]
        traces.append(plotting.ToolTrace(_CONTROLLERS[controller], time, places, run.contour.error))
        columns |= {f"{controller}_{axis}_m": places[:, k].tolist() for k, axis in enumerate("xyz")}
        columns |= {f"{controller}_distance_m": run.contour.error.tolist()}
    first = next(iter(runs.values()))
    columns = {"time_s": first.run.time[first.moving].tolist()} | columns
    links = "three" if name == "figure-28" else "two"
    return Picture(name=name, title=title, columns=columns, figure=plotting.tool_paths(first.path.path.line, traces),
                   caption=f"The paper's {title.partition(':')[0]} is a photograph. Here a SCARA robot of {links} "
                   f"links draws a circle of {number(1e3 * _SIZE)} mm with an HS-755HB at each joint: the tool's path, "
                   "and its distance from the circle.")


def robot_section(robots: Robots | str) -> str:
    """Return the words and tables, and FIGURES where the pictures belong."""
    if isinstance(robots, str):
        return f'<div class="note"><p>The robots are left out. {robots}</p></div>\n'
    least, most = robots.torques["torque"], robots.torques["none"]
    return f"""<p>The model is to serve “the development of control techniques for SCARA type robots with and without
link redundancy, … mobile robots, etc.” (§VII). The paper shows three of them and no dimensions: those here are assumed,
made for the servo <code>hitec-hs-755hb</code> and simulated with its pulses at every joint.</p>
<div class="figures">{FIGURES}</div>
{_arms(robots)}
<p>With the third link the arm may choose its posture. The one in which the circle takes the least torque needs
{number(least, 2)} N m at most of its vertical axes; without a criterion it is {number(most, 2)} N m.</p>
{_drives(robots)}
<p>The wheels of a mobile robot turn without end: the potentiometer stands still, the pulse sets a speed, and a neutral
that is off is a speed that is off. Odometry from the pulses sent does not see that; encoders do.</p>
"""


def _arms(robots: Robots) -> str:
    rows = [[title.partition(": ")[2], _CONTROLLERS[controller], fixed(1e3 * run.metrics.contour_rms, 2),
             fixed(1e3 * run.metrics.contour_largest, 2), fixed(1e3 * run.metrics.tool_rms, 1),
             fixed(run.metrics.energy, 1)]
            for name, title in _ARMS.items() for controller, run in robots.arms[name].items()]
    return table(("robot", "controller", "distance from the circle, rms (mm)", "largest (mm)",
                  "behind its time, rms (mm)", "energy (J)"), rows, text_columns=2,
                 caption=f"A circle of {number(1e3 * _SIZE)} mm at {number(_SPEED)} m/s, pulse servos")


def _drives(robots: Robots) -> str:
    rows = [[words, fixed(1e3 * run.missed, 0), fixed(1e3 * float(run.off_belief[-1]), 0)]
            for words, run in robots.drives.items()]
    return table(("mobile robot", "misses the last point by (mm)", "believes to be elsewhere by (mm)"), rows,
                 caption="Three points, 0.7 m")


def headline(robots: Robots | str) -> dict[str, float]:
    """Return the numbers that count."""
    if isinstance(robots, str):
        return {}
    found = {f"{name.replace('-', '_')}_{controller}_contour_rms_mm": 1e3 * run.metrics.contour_rms
             for name, runs in robots.arms.items() for controller, run in runs.items()}
    return found | {"figure_30_unequal_missed_mm": 1e3 * robots.drives["unequal servos, odometry of pulses"].missed}


# --- Pictures, table and words of the vibration for the report --------------------------------------------------------

_OVERVIEW = 2.5  # s
_CLOSE = (2.0, 2.3)  # s: some swings
_WORDS = {"common": "one soft supply", "separate": "separate supplies"}


def vibration_pictures(study: PaperStudy) -> tuple[Picture, ...]:
    """Return the two pictures of the vibration."""
    return _overview(study), _frames(study)


def _overview(study: PaperStudy) -> Picture:
    """Draw the angle over time, and below it the supply as the program saw it when it looked."""
    time = np.arange(0.0, _OVERVIEW, 2e-3)
    drawn, seen, columns = [], [], {"time_s": time.tolist()}
    for name, words in _WORDS.items():
        one = study.vibration.circuits[name]
        angle = np.degrees(one.run.result.at("output_angle", time))
        looks, volts = _seen(study, one)
        columns |= {f"{name}_output_angle_deg": angle.tolist(), f"{name}_sampled_at_s": looks.tolist(),
                    f"{name}_control_supply_V": volts.tolist()}
        drawn.append(Curve(words, time, angle))
        seen.append(Curve("", np.repeat(looks, 2)[1:], np.repeat(volts, 2)[:-1]))
    figure = plotting.curves(drawn, x_label="time (s)", y_label="output angle $q$ (°)", below=seen,
                             below_label="supply seen\nby the program (V)", height=4.4,
                             limits=[Limit("asked for", math.degrees(study.vibration.target))])
    _scale_supply(figure.axes[1], study)
    figure.axes[0].legend(loc="lower right", handlelength=3.2)
    caption = (f"A step from {_angle(study, 0)}° to {_angle(study, SHOWN_ROW)}° on a supply of "
               f"{number(SOFT)} Ω. Below: what the supply of the control circuit is at the instants at which its "
               "program reads the command. With a supply of its own it is always the same.")
    return Picture(name="figure-vibration", title="Not in the paper: the vibration, and its cure", caption=caption,
                   figure=figure, columns=columns)


def _frames(study: PaperStudy) -> Picture:
    """Draw some swings: what each pulse asks for, the angle, the supply, and where it is looked at."""
    one = study.vibration.circuits["common"]
    time = np.linspace(*_CLOSE, 3001)
    angle, asked = (np.degrees(one.run.result.at(name, time)) for name in ("output_angle", "command_angle"))
    bus = one.run.result.at("bus_voltage", time)
    looks, volts = _seen(study, one)
    inside = (looks > _CLOSE[0]) & (looks < _CLOSE[1])
    looks, volts = looks[inside], volts[inside]
    figure = plotting.curves(
        [Curve("asked for by the pulse", time, asked, style=1), Curve("output angle", time, angle, style=0)],
        x_label="time (s)", y_label="angle (°)", height=4.4,
        below=[Curve("", time, bus, style=0), Curve("", looks, volts, points=True, style=1)],
        below_label="supply (V)")
    _scale_supply(figure.axes[1], study)
    figure.axes[0].margins(y=0.25)  # room for the legend
    figure.axes[0].legend(loc="upper center", ncols=2, handlelength=3.2)
    caption = ("Some frames of the same run on one soft supply. Below: the supply, and where the program looks at the "
               "command (marks). Behind a look into a sag the next pulse asks for less, behind a look at a supply that "
               "has recovered it asks for the full angle, and the shaft jumps.")
    return Picture(name="figure-vibration-frames", title="Not in the paper: how the vibration lives", caption=caption,
                   figure=figure, columns={
                       "time_s": time.tolist(), "output_angle_deg": angle.tolist(), "command_angle_deg": asked.tolist(),
                       "supply_V": bus.tolist(), "sampled_at_s": looks.tolist(), "sampled_supply_V": volts.tolist()})


def _seen(study: PaperStudy, one: Stand) -> tuple[Array, Array]:
    """Return when the program looked [s], and what the supply of the control circuit was [V]."""
    looks = one.control.sampling_times(one.run.pulses)
    looks = looks[looks < _OVERVIEW]
    sag = study.supply - one.run.result.at("bus_voltage", looks)
    return looks, study.supply - one.control.command_share * sag


def _scale_supply(ax: Axes, study: PaperStudy) -> None:
    """Show the voltages at which a supply sags, and not zero."""
    lowest = study.vibration.circuits["common"].still.lowest_bus
    ax.set_ylim(lowest - 0.15, study.supply + 0.15)


def _angle(study: PaperStudy, row: int) -> str:
    return fixed(float(study.table["q_deg"][row]), 0)


def vibration_section(study: PaperStudy, figures: Callable[[Sequence[str]], str]) -> str:
    """Return the words, tables and pictures; `figures` makes HTML of names."""
    common, apart = (study.vibration.circuits[name] for name in ("common", "separate"))
    delay = number(1e3 * common.control.sampling_delay)
    return f"""<p>“In the context of implementation initially developed, the servomotor presented vibrations and little
jumps when positioning in a specific angle.” The authors cured it with a source for the servo that is independent of
that of the control circuit, with delays between the samples of the command, and with a stable reference for the
converter. The paper's equations cannot show it. The pulse servo can, on a bench on which all hangs on one supply:
the voltage that commands it, v<sub>i</sub>, falls in proportion with the supply (a potentiometer across it), and the
program reads it {delay} ms after the end of each pulse and makes the next pulse of what it read.</p>
<p><strong>With one supply of {number(SOFT)} Ω the shaft never comes to rest: {_swing(common)} from end to end,
{fixed(common.still.frequency, 0)} times a second, with {fixed(common.still.current, 2)} A (rms) in the motor. With a
supply of its own for the control circuit, and nothing else changed, it stands: in
{fixed(common.run.result.ended - LOOKED_AT, 1)} s it moves by {_swing(apart)}, all of it creep towards the edge of the
deadband.</strong></p>
<div class="figures">{figures(("figure-vibration", "figure-vibration-frames"))}</div>
{_circuits(study)}
<p>The servo starts to move where the pulse ends, so a program that looks just then looks into the sag of that very
move. It reads less, the next pulse is shorter, and the shaft turns back; that drive makes the supply sag, too, and the
command stays too low. So the shaft goes where the sagging supply sends it. There the drives become shorter than
{delay} ms, the program sees a supply that has recovered, sends a pulse for the full angle, and the shaft jumps. Hence a
late sample is a cure as well, and so is a reference that sags along with the command. A reference that sags alone is no
better than a command that does.</p>
{_angles(study)}
<p>At some angles the shaft vibrates, at others it creeps and jumps now and then. The paper does not mention that the
mean angle is then wrong by many degrees; it has to be if the command sags in proportion, and somebody who turns a knob
until the dial is right would not notice. A regulator or a capacitor before the potentiometer makes all of it smaller.
The {number(SOFT)} Ω, the proportion and the instant of the sample are assumed: the paper gives none of them. So this
shows that the paper's explanation works, and not that its bench was this one.</p>
"""


def _circuits(study: PaperStudy) -> str:
    rows = [[words, fixed(math.degrees(one.off), 1), fixed(math.degrees(one.still.swing), 2),
             fixed(one.still.frequency, 1), fixed(one.still.current, 2), fixed(one.still.lowest_bus, 2)]
            for name, (words, _, _) in CIRCUITS.items() for one in (study.vibration.circuits[name],)]
    return table(("circuit", "mean less target (°)", "swing, end to end (°)", "swings (1/s)", "current (A rms)",
                  "lowest supply of the servo (V)"), rows,
                 caption=f"At {_angle(study, SHOWN_ROW)}°, from {number(LOOKED_AT)} s on")


def _angles(study: PaperStudy) -> str:
    pairs = zip(study.vibration.common, study.vibration.separate, strict=True)
    rows = [[f"{_angle(study, k)}°", fixed(math.degrees(one.off), 1), fixed(math.degrees(one.still.swing), 2),
             fixed(one.still.frequency, 1), fixed(math.degrees(two.off), 1), fixed(math.degrees(two.still.swing), 2),
             fixed(two.still.frequency, 1)] for k, (one, two) in enumerate(pairs)]
    return table(("row of Table II", "one supply: mean less target (°)", "swing (°)", "swings (1/s)",
                  "separate: mean less target (°)", "swing (°)", "swings (1/s)"), rows,
                 caption=f"At every angle of Table II, reached from {_angle(study, 0)}° (0° from {_angle(study, 1)}°)")


def _swing(one: Stand) -> str:
    return f"{fixed(math.degrees(one.still.swing), 2)}°"


# --- The report as one HTML page that needs nothing but itself --------------------------------------------------------

_SECTIONS = (
    ("summary", "Summary"), ("values", "What the paper does not give"), ("step", "The step from 0 to 180°"),
    ("bench", "The bench"), ("measured", "Measured beside simulated"), ("fits", "Straight lines through Table II"),
    ("vibration", "The vibration of the first implementation"),
    ("robots", "The robots that it is for"),
    ("models", "Block diagrams and transfer functions"), ("corrections", "Corrections to the paper"),
    ("disagreements", "Disagreements and gaps in its data"), ("parameters", "Parameters and where they come from"),
    ("files", "Files beside this report"),
)


def page(study: PaperStudy, robots: RobotsPart, drawings: Sequence[Drawing]) -> str:
    """Return the whole report."""
    images = {drawn.name: drawn for drawn in drawings}
    parts = {
        "summary": _summary(study), "values": _values(study), "step": _step(study, images),
        "bench": _bench(study, images), "measured": _measured(study, images),
        "fits": _fits(study), "vibration": vibration_section(study, lambda names: _figures(names, images)),
        "robots": robots.words.replace(FIGURES,
                                       _figures([drawn.name for drawn in robots.drawings], images)),
        "models": _models(study, images),
        "corrections": tables.findings_table(corrections(study), "What the equations need"),
        "disagreements": tables.findings_table(disagreements(study), "What the data say"),
        "parameters": _parameters(study), "files": _files(drawings),
    }
    contents = "".join(f'<li><a href="#{key}">{title}</a></li>' for key, title in _SECTIONS)
    body = "".join(f'<section id="{key}"><h2>{title}</h2>\n{parts[key]}</section>\n' for key, title in _SECTIONS)
    return document("A New Model for Analog Servo Motors: simulated again", f"""\
<h1>A New Model for Analog Servo Motors: simulated again</h1>
<p class="lead">The figures, tables and equations of C. Urrea and J. Kern, “A New Model for Analog Servo Motors.
Simulations and Experimental Results”, <cite>Canadian Journal on Automation, Control and Intelligent Systems</cite>
2(2), March 2011 (“the paper”), computed with servotwin {escape(__version__)} for the servo
<code>{escape(SERVO)}</code>. Numbers in round brackets are equations of the paper.</p>
<nav aria-label="Contents"><ol>{contents}</ol></nav>
{body}""")


def _summary(study: PaperStudy) -> str:
    peak = study.peak_voltage["averaged"]
    bounded, pulse = study.on_bench["bounded"], study.on_bench["pulse"]
    common, apart = (study.vibration.circuits[name].still for name in ("common", "separate"))
    cards = []
    for name, one in study.on_bench.items():
        cards.append((f"{fixed(math.degrees(one.worst('output_angle')), 2)}°, "
                      f"{fixed(1e3 * one.worst('feedback_voltage'), 1)} mV",
                      f"largest difference to Table II of the {escape(LABELS[name])}: angle, feedback voltage; pulse "
                      f"width {fixed(1e6 * one.worst('pulse_width'), 1)} µs, ADC<sub>o</sub> "
                      f"{one.worst('feedback_count'):.0f} counts"))
    cards += [
        (f"{fixed(peak, 1)} V = {fixed(peak / study.supply, 1)} × supply",
         "what the printed model puts on the motor in a step of 180°: (38) has no bound"),
        (f"{fixed(study.metrics['averaged'].rise_time, 2)} s against {fixed(study.metrics['bounded'].rise_time, 2)} s",
         "rise time of that step, printed model against a servo whose supply ends"),
        (f"{fixed(math.degrees(study.metrics['bounded'].slew_rate), 0)} °/s",
         f"top speed of the bounded and the pulse servo{_sheet_speed(study)}"),
        (f"± {fixed(math.degrees(bounded.widest), 2)}° against ± {fixed(math.degrees(pulse.widest), 2)}°",
         "how far from its target the shaft may stand, with the mean voltage of the pulses and with the pulses"),
        (f"{bounded.rows[0].reading.pulse_rate:.3f} Hz",
         "pulse rate of the bench, 1024 steps of 16 µs; the paper prints 61"),
    ]
    cards.append((f"{fixed(math.degrees(common.swing), 1)}° at {fixed(common.frequency, 0)} Hz against "
                  f"{fixed(math.degrees(apart.swing), 2)}°",
                  "swing of the shaft at a constant command, with servo and control circuit on one soft supply and "
                  "with separate ones"))
    listed = "".join(f"<li><b>{value}</b>{words}</li>" for value, words in cards)
    share = max(abs(s.rest) + abs(s.standing) for one in (bounded, pulse) for s in one.angle_shares)
    return f"""<ul class="numbers">{listed}</ul>
<ul><li>All five rows of Table II are met by all three models. What is left is the curvature of the measured angle over
pulse width; everything else together stays below {fixed(math.degrees(share), 2)}° for the bounded and the pulse servo.
The potentiometer and the command chain were calibrated with the same table, so this shows that the chain is consistent;
it is no independent test.</li>
<li>The static characteristic, which is what the paper measured, cannot tell the models apart. The step tells the
printed model from the others: it is
{fixed(study.metrics['bounded'].rise_time / study.metrics['averaged'].rise_time, 1)} times as fast, because its armature
voltage has no bound.</li>
<li>Where the shaft comes to a stand tells pulses from their mean: friction holds a servo of the mean voltage up to
{fixed(math.degrees(bounded.friction), 2)}° before the edge of its deadband, the pulse servo only
{fixed(math.degrees(pulse.friction), 2)}°. Until then the two move alike.</li>
<li>{len(corrections(study))} places of the equations need a correction or a remark, and {len(disagreements(study))}
places of the data disagree with each other or leave something out; each is listed with the number that shows
it.</li></ul>
"""


def _sheet_speed(study: PaperStudy) -> str:
    seconds = study.sheet_seconds_per_60deg
    return f" (the maker's sheet: {number(seconds)} s for 60°, {fixed(60.0 / seconds, 0)} °/s)" if seconds else ""


def _values(study: PaperStudy) -> str:
    count = tables.origins(study)
    words = ", ".join(f"{n} {origin}" for origin, n in sorted(count.items(), key=lambda item: -item[1]))
    return f"""<div class="note"><p><strong>The paper publishes no parameter values.</strong> It gives no number for
k<sub>a</sub>, k<sub>b</sub>, R<sub>a</sub>, L<sub>a</sub>, J<sub>m</sub>, B<sub>m</sub>, n, A, k<sub>s</sub>,
k<sub>p</sub>, p, F<sub>ec</sub> or k. Its simulated curves (Figures 13 to 17) therefore cannot be compared with the
ones here, curve for curve, and nothing here was tuned to look like them. What can be compared is Table II and Figures
22 to 27, which were measured.</p></div>
<p>The {sum(count.values())} values used here come from elsewhere: {words}. “Measured” is a least-squares fit to Table
II. “Datasheet” is the maker's sheet of the HS-755HB, or follows from it. “Assumed” is a prior that no source gives;
most have a range, and they have to be identified for a real unit. <a href="#parameters">The list</a> names each.</p>
"""


def _step(study: PaperStudy, images: Images) -> str:
    names = ("figure-13", "figure-14", "figure-15", "figure-16", "figure-armature-voltage", "figure-last-degrees",
             "figure-17")
    return f"""<p>The command goes from 0 to 180° at 0.1 s. The load is an inertia of {number(LOAD_INERTIA)} kg m²
(assumed; the paper does not say what its simulated servo carried). All models have the same servo file. The averaged
servo is the paper's model, (35) to (41) with the two offsets that the measured servo needs. The bounded servo has in
addition a supply that ends, a deadband, friction that holds, and end stops. The pulse servo does not average: in every
frame its bridge gives the full voltage for as long as the error asks, and brakes for the rest.</p>
<div class="figures">{_figures(names, images)}</div>
{tables.step_table(study)}"""


def _bench(study: PaperStudy, images: Images) -> str:
    apparatus = study.on_bench["bounded"].bench
    low, high = study.offsets
    servo = apparatus.model.servo
    before, after = study.value("electronics.bridge_gain"), servo.get("electronics.bridge_gain")
    gain = f"{fixed(before, 1)} to {fixed(float(after), 1)}" if isinstance(after, int | float) else "its value"
    return f"""<p>The simulated bench repeats the paper's: V<sub>i</sub> → 10-bit converter (2.5 V) → pulses → servo →
potentiometer → 10-bit converter → the seven readings of the display.</p>
<ul><li>The converter at the command has {fixed(apparatus.input_converter.gain, 1)} counts/V. Its zero offset is
<strong>identified from Table II</strong>: only from {fixed(low, 2)} to below {fixed(high, 2)} counts do the printed
V<sub>i</sub> give all five printed pulse widths; the middle, {fixed(study.offsets.middle, 2)}, is used.</li>
<li>The generator makes 16 m + 6 µs with m = ⌊(ADC<sub>i</sub> − 1)/6⌋ − 1, once in
{fixed(1e3 * apparatus.generator.frame_period, 3)} ms (inferred from the five rows).</li>
<li>The converter at the potentiometer is the fitted line ADC<sub>o</sub> = 432.65 V<sub>o</sub> − 44.1, rounded. It
is a description and no circuit.</li>
<li>The servo file is for frames of 20 ms. By the averaging theory A k<sub>s</sub> goes as 1/T<sub>f</sub>, so on the
bench A goes from {gain} V/V. The pulse servo needs no such rule: it takes the generator's frames and widths as they
come.</li>
<li>A servo stops short, from either side. Each angle is approached from 30° below and from 30° above (less where the
travel ends), with a wait until the shaft stands or for 5 s; a row is the mean, and half the difference is its
standing band. The smoothed friction (41) never quite stands, and the pulses move the shaft by ever smaller
steps: the averaged and the pulse servo are read while they still creep.</li></ul>
<div class="figures">{_figures(("figure-22", "figure-23", "figure-24"), images)}</div>
{tables.ranges_table(study)}"""


def _measured(study: PaperStudy, images: Images) -> str:
    shares = "".join(tables.model_shares_table(study, name) for name in study.on_bench)
    return f"""<div class="figures">{_figures(("figure-25", "figure-26", "figure-27"), images)}</div>
{tables.comparison_table(study)}
{tables.difference_table(study)}
<h3>How far from its target a servo may stand</h3>
<div class="figures">{_figures(("figure-standing",), images)}</div>
{tables.band_table(study)}
{_band_words(study)}
<h3>What the differences are made of</h3>
<p>The 16 µs steps move the measured and the simulated servo alike, so they are seen against a straight line over
V<sub>i</sub> and not between the two:</p>
{tables.measured_shares_table(study)}
<p>Between simulated and measured there remain: another pulse width than the printed one (none), the curvature that a
straight servo cannot have, an unequal stop from either side, and the calibration of the servo file (V<sub>o</sub> over
t<sub>a</sub> and V<sub>o</sub> over q, rounded, against q over t<sub>a</sub>). The shares add up.</p>
{shares}"""


def _band_words(study: PaperStudy) -> str:
    """Return what the bands say about the paper's points, and why pulses narrow them."""
    bounded, pulse = study.on_bench["bounded"], study.on_bench["pulse"]
    dead = study.shortest_pulse
    swallowed = dead / (study.value("electronics.stretcher_gain") * study.value("electronics.one_shot_slope")
                        * study.value("potentiometer.feedback_gain"))
    return f"""<p>The paper does not say from which side its angles were approached. Its points lie within
{fixed(study.fits['q(V_i)'].line.max_residual, 1)}° of a line, yet a servo that gets the mean of its pulses may stop
anywhere within ± {fixed(math.degrees(bounded.widest), 1)}°. <strong>The pulse servo, with the same parameters, stops
within ± {fixed(math.degrees(pulse.widest), 2)}°: its band is {fixed(bounded.widest / pulse.widest, 1)} times
narrower.</strong> The electrical deadband is the same for both; the share of friction falls from ±
{fixed(math.degrees(bounded.friction), 2)}° to ± {fixed(math.degrees(pulse.friction), 2)}°, and the longer one waits,
the less remains of it.</p>
<p>The reason: a pulse, however short, has the full voltage, good for {number(study.full_torque, 3)} N m at a shaft at
rest, against {number(study.friction_torque, 2)} N m of dry friction. So every pulse moves the shaft, while the mean of
short pulses moves nothing. The wide band is a property of the mean and not of the servo; the paper's points do not ask
for a higher loop gain.</p>
<p>A narrow band leaves less to chance. The band of the bounded servo holds {_inside(bounded)} of the five measured
angles, so that friction alone might have bent the line through them; the band of the pulse servo holds
{_inside(pulse)}. With pulses the bend is not where friction happened to hold the shaft, and the paper says nothing of
what else it may be: the potentiometer, the one-shot, or the reading of the dial.</p>
<p>All this holds for the values of the servo file, most of which are not measured. The armature
inductance, which this servo neglects, would swallow pulses of less than about {fixed(1e6 * dead, 0)} µs:
{fixed(math.degrees(swallowed), 2)}° more.</p>"""


def _inside(one: BenchStudy) -> str:
    """Return how many measured angles lie within the standing band of the simulated row."""
    count = sum(abs(d.output_angle) <= row.standing_band for d, row in zip(one.differences, one.rows, strict=True))
    return "none" if count == 0 else "all" if count == len(one.rows) else f"{count}"


def _fits(study: PaperStudy) -> str:
    curved = [tables.pretty(name) for name, fit in study.fits.items() if fit.curvature.p_value < 0.05]
    verdict = f"At the 5 % level curved: {', '.join(curved)}." if curved else "None is curved at the 5 % level."
    return f"""{tables.fits_table(study)}<p>Five points leave three degrees of freedom to a line and two to a
parabola. p is the probability of such an F or a larger one if the truth were straight. {verdict}</p>
"""


def _models(study: PaperStudy, images: Images) -> str:
    parts = ["<p>The paper's diagrams, redrawn, with their transfer functions. The numbers are those of the servo "
             "file; dry friction has no transfer function and is left out.</p>"]
    for which, formulas in linear_views.FORMULAS.items():
        lines = [f"<p>{linear_views.formula(text)}<span>{equation}</span></p>" for equation, text in formulas]
        numeric = linear_views.numeric(study, which)
        if numeric is not None:
            poles = ", ".join(_pole(p) for p in numeric.poles if p.imag >= 0.0)
            shown = linear_views.formula(numeric.text)
            lines.append(f"<p>{shown}<span>{numeric.words}; poles (1/s): {poles}</span></p>")
        after = f'<div class="formulas">{"".join(lines)}</div>'
        parts.append(_figure(images[f"figure-{which:02d}"], after=after, wide=True))
    return "\n".join(parts)


def _pole(p: complex) -> str:
    if abs(p.imag) < 1e-9 * max(abs(p), 1.0):
        return fixed(p.real, 1) if p.real else "0"
    return f"{fixed(p.real, 1)} ± {fixed(p.imag, 1)} j"


def _parameters(study: PaperStudy) -> str:
    return f"""<p>No value here is one of the paper's authors. A range belongs to an assumed or derived value, ± one
standard error to a fitted one.</p>
{tables.parameter_table(study)}"""


def _files(drawings: Sequence[Drawing]) -> str:
    formats = " and ".join(name.upper() for name in drawings[0].files)
    return f"""<p>Beside this page lie {len(drawings)} pictures as {formats} in <code>figures/</code>, and the numbers
behind each plot in <code>data/</code>, with the unit in every column's name: one CSV file per plot,
<code>table-2.csv</code> (measured and simulated), <code>fits.csv</code> and <code>parameters.csv</code>.</p>
<p>Made by <code>servotwin paper</code>.</p>
"""


def _figures(names: Sequence[str], images: Images) -> str:
    return "\n".join(_figure(images[name]) for name in names)


def _figure(made: Drawing, *, after: str = "", wide: bool = False) -> str:
    image = picture(made.files["png"], f"{made.title}. {untagged(made.caption)}", kind="drawing", media="image/png",
                    style=f"--w:{96.0 * made.width:.0f}px" if wide else "")
    kind = ' class="wide"' if wide else ""
    return (f'<figure{kind} id="{made.name}"><div>{image}</div>\n{after}<figcaption><b>{made.title}.</b> '
            f"{made.caption}</figcaption></figure>")
