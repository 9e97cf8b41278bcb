"""The page of a servo's linear views: HTML that needs nothing but itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from servotwin import plotting
from servotwin.cli.linear_words import LOOP_HEAD, SINE_HEAD, loop_rows, mean_pairs, sine_rows
from servotwin.look import CURVES_A_PAGE, document, escape, on_page, pages, picture, table, to_bytes
from servotwin.plotting import Response

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from servotwin.linear.overview import Overview

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


def page(found: Overview) -> str:
    """Return the page of a servo's linear views."""
    servo = found.model.servo
    title = servo.title or servo.name
    said = "".join(f"<p>{escape(name)}: {escape(text)}.</p>" for name, text in mean_pairs(found))
    parts = [_figure([by_amplitude(found, page) for page in pages(len(found.sines), CURVES_A_PAGE)],
                     "Angle over commanded angle: small signals (lines) and simulated sines of finite size (marks). "
                     "The grey line is 3 dB below the command. Where friction holds the shaft for a part of the sine, "
                     "no line is drawn for its describing functions.")]
    parts.append(table(list(SINE_HEAD), [[escape(_signs(cell)) for cell in row] for row in sine_rows(found)],
                       caption="Simulated sines"))
    if found.loops:
        parts.append("<h2>As it decides</h2>")
        parts.append(table(list(LOOP_HEAD), [[escape(_signs(cell)) for cell in row] for row in loop_rows(found)],
                           caption="The sampled loop, friction and deadband apart"))
        parts.append(_figure([by_frames(found, page) for page in pages(len(found.loops), CURVES_A_PAGE)],
                             "Small sines by the time between decisions: shorter frames make an analog servo stiffer "
                             "and faster, and less damped."))
        own = next(iter(found.loops.values()))
        parts.append(_figure([plotting.root_locus(own)], "Where the poles of the sampled loop go as its gain grows. To "
                             "the right of the axis it is unstable."))
    facts = f"<code>{escape(servo.name)}</code>, {escape(servo.kind)}, {type(found.model).__name__}"
    return document(f"{title}: linear views", f"<h1>{escape(title)}</h1>\n<p class=\"lead\">{facts}</p>\n{said}"
                    + "\n".join(parts), style=_STYLE)


def _signs(text: str) -> str:
    return text.replace(" deg", "°").replace("+/-", "±").replace("-", "−")


def _figure(drawn: Sequence[Figure], words: str) -> str:
    """Return the pages of a picture, one below the other, with words below them."""
    images = "".join(picture(to_bytes(figure, "svg"), words, kind="drawing") for figure in drawn)
    return f"<figure><div>{images}</div><figcaption>{words}</figcaption></figure>\n"
