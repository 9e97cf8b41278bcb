"""The page of a servo's linear views: HTML that needs nothing but itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from servotwin import plotting
from servotwin.cli.linear_words import LOOP_HEAD, SINE_HEAD, loop_rows, mean_pairs, sine_rows
from servotwin.look import document, escape, picture, table, to_bytes
from servotwin.plotting import Response

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from servotwin.linear.overview import Overview

_STYLE = "figure img.drawing{width:100%;max-width:44rem}"
_MOST = 5  # curves that can be told apart


def by_amplitude(found: Overview) -> Figure:
    """Return gain and phase of simulated sines by their amplitude, with what the linear views say."""
    drawn = []
    if found.mean is not None:
        drawn.append(Response("mean of the voltage", found.frequency, found.mean, False, 4))
    for period, loop in list(found.loops.items())[:1]:
        fine = _fine(found, loop.half_rate)
        drawn.append(Response(f"decides every {1e3 * period:.4g} ms", fine, loop.response(fine), False, 0))
    for k, each in enumerate(found.sines[:_MOST]):
        size = f"{math.degrees(each.amplitude):.3g}°"
        drawn.append(Response(f"sines of {size}, simulated", found.frequency, found.simulated.response[k], True, k))
        if each.described is not None and not each.sticks.all():
            free = ~each.sticks
            drawn.append(Response(f"describing functions, {size}", found.frequency[free], each.described[free], False,
                                  k + 1 if k + 1 < _MOST else 0))
    return plotting.bode(drawn, height=5.2)


def by_frames(found: Overview) -> Figure:
    """Return gain and phase of small sines by the time between decisions."""
    drawn = []
    for k, (period, loop) in enumerate(found.loops.items()):
        fine = _fine(found, loop.half_rate)
        drawn.append(Response(f"every {1e3 * period:.4g} ms", fine, loop.response(fine), False, k))
    return plotting.bode(drawn[:_MOST], height=4.2)


def _fine(found: Overview, half_rate: float) -> np.ndarray:
    most = min(float(found.frequency[-1]) * 2.0, half_rate * (1.0 - 1e-9))
    return np.geomspace(float(found.frequency[0]), most, 300)


def page(found: Overview) -> str:
    """Return the page of a servo's linear views."""
    servo = found.model.servo
    title = servo.title or servo.name
    said = "".join(f"<p>{escape(name)}: {escape(text)}.</p>" for name, text in mean_pairs(found))
    parts = [_figure(by_amplitude(found), "Angle over commanded angle: small signals (lines) and simulated sines of "
                     "finite size (marks). The grey line is 3 dB below the command. Where friction holds the shaft "
                     "for a part of the sine, no line is drawn for its describing functions.")]
    parts.append(table(list(SINE_HEAD), [[escape(_signs(cell)) for cell in row] for row in sine_rows(found)],
                       caption="Simulated sines"))
    if found.loops:
        parts.append("<h2>As it decides</h2>")
        parts.append(table(list(LOOP_HEAD), [[escape(_signs(cell)) for cell in row] for row in loop_rows(found)],
                           caption="The sampled loop, friction and deadband apart"))
        parts.append(_figure(by_frames(found), "Small sines by the time between decisions: shorter frames make an "
                             "analog servo stiffer and faster, and less damped."))
        own = next(iter(found.loops.values()))
        parts.append(_figure(plotting.root_locus(own), "Where the poles of the sampled loop go as its gain grows. To "
                             "the right of the axis it is unstable."))
    facts = f"<code>{escape(servo.name)}</code>, {escape(servo.kind)}, {type(found.model).__name__}"
    return document(f"{title}: linear views", f"<h1>{escape(title)}</h1>\n<p class=\"lead\">{facts}</p>\n{said}"
                    + "\n".join(parts), style=_STYLE)


def _signs(text: str) -> str:
    return text.replace(" deg", "°").replace("+/-", "±").replace("-", "−")


def _figure(figure: Figure, words: str) -> str:
    drawn = picture(to_bytes(figure, "svg"), words, kind="drawing")
    return f"<figure><div>{drawn}</div><figcaption>{words}</figcaption></figure>\n"
