"""Pictures, table and words of the vibration for the report."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from servotwin import plotting
from servotwin.look import fixed, number, table
from servotwin.paper.figures import Picture
from servotwin.paper.vibration import CIRCUITS, LOOKED_AT, SHOWN_ROW, SOFT
from servotwin.plotting import Curve, Limit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from servotwin.paper.study import PaperStudy
    from servotwin.paper.vibration import Stand

    Array = NDArray[np.float64]

_OVERVIEW = 2.5  # s
_CLOSE = (2.0, 2.3)  # s: some swings
_WORDS = {"common": "one soft supply", "separate": "separate supplies"}


def pictures(study: PaperStudy) -> tuple[Picture, ...]:
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


def section(study: PaperStudy, figures: Callable[[Sequence[str]], str]) -> str:
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
