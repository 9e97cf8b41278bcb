"""The block diagrams of the paper: Figures 2, 4, 5, 6 and 8, redrawn."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.errors import InputError
from servotwin.look import COLOURS, context, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# --- A small kit for block diagrams: blocks, summing points, arrows, labels in math text ------------------------------

_INK = COLOURS["black"]
_UNIT = 0.62  # inch per unit of the drawing


class Node(NamedTuple):
    """Something with a place: centre and half of width and height, in units of the drawing."""

    x: float
    y: float
    half_width: float
    half_height: float

    @property
    def left(self) -> tuple[float, float]:
        """Middle of the left side."""
        return self.x - self.half_width, self.y

    @property
    def right(self) -> tuple[float, float]:
        """Middle of the right side."""
        return self.x + self.half_width, self.y

    @property
    def top(self) -> tuple[float, float]:
        """Middle of the upper side."""
        return self.x, self.y + self.half_height

    @property
    def bottom(self) -> tuple[float, float]:
        """Middle of the lower side."""
        return self.x, self.y - self.half_height


class Diagram:
    """A drawing of so many units, one unit being the height of a block.

    Parameters
    ----------
    width, height : float
        Of the drawing; its lower left corner is (0, 0).

    Examples
    --------
    >>> diagram = Diagram(4.0, 1.5)
    >>> block = diagram.block(2.0, 0.75, r"$k_a$")
    >>> diagram.line((0.2, 0.75), block.left, arrow=True)
    >>> len(diagram.figure.axes)
    1
    """

    def __init__(self, width: float, height: float) -> None:
        with context():
            self.figure: Figure = new_figure(_UNIT * width, _UNIT * height)
            self.figure.set_layout_engine("none")
            self._axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self._axes.set_xlim(0.0, width)
        self._axes.set_ylim(0.0, height)
        self._axes.set_axis_off()

    def block(self, x: float, y: float, text: str, *, width: float = 1.0, height: float = 0.9,
              size: float = 11.0) -> Node:
        """Return a block with its centre at (x, y)."""
        from matplotlib.patches import Rectangle

        node = Node(x, y, width / 2.0, height / 2.0)
        self._axes.add_patch(Rectangle((x - width / 2.0, y - height / 2.0), width, height, facecolor="#F4F7FA",
                                       edgecolor=_INK, linewidth=1.1, zorder=3))
        self.text(x, y, text, size=size)
        return node

    def sum(self, x: float, y: float, *signs: tuple[str, str]) -> Node:
        """Return a summing point; `signs` are pairs of a side ("left", "top", "bottom") and "+" or "−"."""
        from matplotlib.patches import Circle

        radius = 0.2
        self._axes.add_patch(Circle((x, y), radius, facecolor="white", edgecolor=_INK, linewidth=1.1, zorder=3))
        places = {"left": (-0.32, 0.2), "top": (0.2, 0.34), "bottom": (0.2, -0.34)}
        for side, sign in signs:
            dx, dy = places[side]
            self.text(x + dx, y + dy, sign, size=10.0)
        return Node(x, y, radius, radius)

    def line(self, *points: tuple[float, float], arrow: bool = False, dashed: bool = False) -> None:
        """Draw a line through points, with an arrow at its end if asked for."""
        style: Any = (0, (4, 2)) if dashed else "-"
        xs, ys = [p[0] for p in points], [p[1] for p in points]
        if arrow:
            self._axes.annotate("", xy=points[-1], xytext=points[-2], zorder=2, arrowprops={
                "arrowstyle": "-|>,head_width=0.22,head_length=0.42", "color": _INK, "linewidth": 1.1,
                "shrinkA": 0.0, "shrinkB": 0.0, "linestyle": style})
            xs, ys = xs[:-1], ys[:-1]
        if len(xs) > 1:
            self._axes.plot(xs, ys, color=_INK, linewidth=1.1, linestyle=style, solid_joinstyle="miter", zorder=2)

    def dot(self, x: float, y: float) -> None:
        """Mark a point where a line branches."""
        self._axes.plot([x], [y], marker="o", markersize=3.4, color=_INK, zorder=3)

    def frame(self, left: float, bottom: float, right: float, top: float) -> None:
        """Hatch a rectangle behind the drawing."""
        from matplotlib.patches import Rectangle

        self._axes.add_patch(Rectangle((left, bottom), right - left, top - bottom, facecolor="none",
                                       edgecolor="#C9CED4", linewidth=0.8, hatch="////", zorder=0))

    def text(self, x: float, y: float, text: str, *, size: float = 10.0, align: str = "center") -> None:
        """Write a text around (x, y), "left" or "right" of it if said so."""
        with context():
            self._axes.text(x, y, text, ha=align, va="center", fontsize=size, color=_INK, zorder=4, parse_math=True)


# --- Formulas as pictures, for pages that must read without the network -----------------------------------------------

@dataclass(frozen=True, kw_only=True)
class Formula:
    """A formula as an SVG picture.

    Parameters
    ----------
    svg : str
        The picture.
    width, height : float
        Its size at 10 pt letters [pt].
    """

    svg: str
    width: float
    height: float


@cache
def formula_svg(source: str, size: float = 10.0) -> Formula:
    r"""Return a formula in matplotlib's math text as an SVG picture.

    Parameters
    ----------
    source : str
        Such as ``r"$v_o = p\,q + b_o$"``.
    size : float
        Of the letters [pt].

    Raises
    ------
    ValueError
        If the math text is malformed.

    Examples
    --------
    >>> formula_svg(r"$k_a i_a$").svg.startswith("<svg")
    True
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties
    from matplotlib.mathtext import MathTextParser

    with context():
        prop = FontProperties(size=size)
        width, height, depth, *_ = MathTextParser("path").parse(source, dpi=72, prop=prop)
        margin = 0.15 * size
        width, height = width + 2 * margin, height + 2 * margin
        figure = Figure(figsize=(width / 72.0, height / 72.0))
        figure.patch.set_visible(False)
        FigureCanvasSVG(figure)
        figure.text(margin / width, (depth + margin) / height, source, fontproperties=prop, parse_math=True)
        with io.StringIO() as stream:
            figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None}, transparent=True)
            text = stream.getvalue()
    return Formula(svg=text[text.index("<svg"):], width=width, height=height)


# --- The block diagrams of the paper: Figures 2, 4, 5, 6 and 8, redrawn -----------------------------------------------

_Y = 2.3  # height of the forward path


def _chain(diagram: Diagram, start: float, nodes: list[Node], end: float) -> None:
    """Join nodes from left to right, with a line before and one behind."""
    x = start
    for node in nodes:
        diagram.line((x, _Y), node.left, arrow=True)
        x = node.right[0]
    diagram.line((x, _Y), (end, _Y), arrow=True)


def _motor() -> Diagram:
    """Figure 2: the DC motor, eq. (15)."""
    d = Diagram(11.4, 3.2)
    add = d.sum(1.5, _Y, ("left", "+"), ("bottom", "−"))
    nodes = [add, d.block(3.35, _Y, r"$\dfrac{1}{L_a s + R_a}$", width=1.5, size=10.5), d.block(5.35, _Y, r"$k_a$"),
             d.block(7.35, _Y, r"$\dfrac{1}{J_m s + B_m}$", width=1.5, size=10.5),
             d.block(9.6, _Y, r"$\dfrac{1}{s}$", width=0.8, size=10.5)]
    _chain(d, 0.35, nodes, 11.1)
    _back_emf(d, 8.65, 5.35, add)
    for x, label in ((0.75, r"$V_a$"), (2.15, r"$V_a - V_b$"), (4.5, r"$I_a$"), (6.2, r"$\tau_m$"),
                     (8.65, r"$s\Theta_m$"), (10.55, r"$\Theta_m$")):
        d.text(x, _Y + (0.62 if x == 2.15 else 0.28), label)
    return d


def _back_emf(d: Diagram, branch: float, middle: float, add: Node) -> None:
    """Draw the path from the motor's speed back to the voltage."""
    d.dot(branch, _Y)
    block = d.block(middle, 0.65, r"$k_b$")
    d.line((branch, _Y), (branch, 0.65), block.right, arrow=True)
    d.line(block.left, (add.x, 0.65), add.bottom, arrow=True)
    d.text(add.x + 0.55, 0.88, r"$V_b$")


def _geared() -> Diagram:
    """Figure 4: the DC motor with a load behind a gear."""
    d = Diagram(14.8, 4.6)
    d.frame(6.0, 1.75, 13.65, 4.5)
    add = d.sum(1.4, _Y, ("left", "+"), ("bottom", "−"))
    torque = d.sum(6.65, _Y, ("left", "+"), ("top", "−"))
    nodes = [add, d.block(3.15, _Y, r"$\dfrac{1}{L_a s + R_a}$", width=1.5, size=10.5),
             d.block(5.0, _Y, r"$k_a$", width=0.9), torque,
             d.block(8.35, _Y, r"$\dfrac{1}{J_m s + B_m}$", width=1.5, size=10.5),
             d.block(10.6, _Y, r"$\dfrac{1}{s}$", width=0.8, size=10.5), d.block(12.2, _Y, r"$n$", width=0.8)]
    _chain(d, 0.3, nodes, 14.5)
    _back_emf(d, 9.65, 5.0, add)
    _load_path(d, 13.2, torque, (10.7, 8.35))
    for x, label in ((0.65, r"$V_a$"), (4.23, r"$I_a$"), (5.82, r"$T_o$"), (9.62, r"$s\Theta_m$"),
                     (11.4, r"$\Theta_m$"), (14.0, r"$\Theta_L$")):
        d.text(x, _Y + 0.28, label)
    return d


def _load_path(d: Diagram, branch: float, torque: Node, middles: tuple[float, float]) -> None:
    """Draw the path from the load's angle back to the torque on the motor."""
    d.dot(branch, _Y)
    load = d.block(middles[0], 3.85, r"$s\,(J_L s + B_L)$", width=2.4)
    gear = d.block(middles[1], 3.85, r"$n$", width=0.8)
    d.line((branch, _Y), (branch, 3.85), load.right, arrow=True)
    d.line(load.left, gear.right, arrow=True)
    d.line(gear.left, (torque.x, 3.85), torque.top, arrow=True)
    d.text((load.left[0] + gear.right[0]) / 2.0, 4.12, r"$T_L$")
    d.text((gear.left[0] + torque.x) / 2.0, 4.12, r"$n T_L$")


def _reflected() -> Diagram:
    """Figure 5: the hatched part of Figure 4 with the load seen from the motor's shaft, eq. (16)."""
    d = Diagram(8.6, 4.6)
    torque = d.sum(1.6, _Y, ("left", "+"), ("top", "−"))
    nodes = [torque, d.block(3.65, _Y, r"$\dfrac{1}{(J_m s + B_m)\,s}$", width=2.1, size=10.5),
             d.block(5.9, _Y, r"$n$", width=0.8)]
    _chain(d, 0.3, nodes, 8.3)
    d.dot(7.0, _Y)
    load = d.block(4.3, 3.85, r"$n\,s\,(J_L s + B_L)$", width=2.6)
    d.line((7.0, _Y), (7.0, 3.85), load.right, arrow=True)
    d.line(load.left, (torque.x, 3.85), torque.top, arrow=True)
    for x, y, label in ((0.8, _Y + 0.28, r"$T_o$"), (2.3, 4.12, r"$n T_L$"), (5.1, _Y + 0.28, r"$\Theta_m$"),
                        (7.7, _Y + 0.28, r"$\Theta_L$")):
        d.text(x, y, label)
    d.text(4.3, 1.1, r"$J_o = J_m + n^2 J_L, \qquad B_o = B_m + n^2 B_L$")
    return d


def _equivalent() -> Diagram:
    """Figure 6: the geared motor with all inertia and friction at the motor's shaft, eq. (22)."""
    d = Diagram(13.0, 3.2)
    add = d.sum(1.5, _Y, ("left", "+"), ("bottom", "−"))
    nodes = [add, d.block(3.35, _Y, r"$\dfrac{1}{L_a s + R_a}$", width=1.5, size=10.5), d.block(5.35, _Y, r"$k_a$"),
             d.block(7.35, _Y, r"$\dfrac{1}{J_o s + B_o}$", width=1.5, size=10.5),
             d.block(9.6, _Y, r"$\dfrac{1}{s}$", width=0.8, size=10.5), d.block(11.2, _Y, r"$n$", width=0.8)]
    _chain(d, 0.35, nodes, 12.7)
    _back_emf(d, 8.65, 5.35, add)
    for x, label in ((0.75, r"$V_a$"), (2.15, r"$V_a - V_b$"), (4.5, r"$I_a$"), (6.2, r"$T_o$"),
                     (8.65, r"$s\Theta_m$"), (10.4, r"$\Theta_m$"), (12.15, r"$\Theta_L$")):
        d.text(x, _Y + (0.62 if x == 2.15 else 0.28), label)
    return d


def _servo() -> Diagram:
    """Figure 8: the servo on a robot's joint, eq. (38) to (40)."""
    d = Diagram(17.6, 4.6)
    error = d.sum(3.9, _Y, ("left", "+"), ("bottom", "−"))
    add = d.sum(7.65, _Y, ("left", "+"), ("top", "−"))
    torque = d.sum(11.35, _Y, ("left", "+"), ("top", "−"))
    nodes = [d.block(1.3, _Y, r"$k_{p1}$", width=0.9), d.block(2.75, _Y, r"$k_{p2}$", width=0.9), error,
             d.block(5.0, _Y, r"$k_s$", width=0.8), d.block(6.35, _Y, r"$A$", width=0.8), add,
             d.block(8.9, _Y, r"$\dfrac{1}{L_a s + R_a}$", width=1.4, size=10.5),
             d.block(10.45, _Y, r"$k_a$", width=0.75), torque,
             d.block(12.7, _Y, r"$\dfrac{1}{J_m s + B_m}$", width=1.4, size=10.5),
             d.block(14.6, _Y, r"$\dfrac{1}{s}$", width=0.8, size=10.5), d.block(15.75, _Y, r"$n$", width=0.7)]
    _chain(d, 0.25, nodes, 17.4)
    d.dot(13.8, _Y)
    emf = d.block(10.1, 3.85, r"$k_b$", width=0.8)
    d.line((13.8, _Y), (13.8, 3.85), emf.right, arrow=True)
    d.line(emf.left, (add.x, 3.85), add.top, arrow=True)
    d.line((torque.x, 3.45), torque.top, arrow=True)
    d.dot(16.6, _Y)
    pot = d.block(10.1, 0.65, r"$p$", width=0.8)
    d.line((16.6, _Y), (16.6, 0.65), pot.right, arrow=True)
    d.line(pot.left, (error.x, 0.65), error.bottom, arrow=True)
    up = _Y + 0.28
    for x, y, label in ((0.5, up, r"$v_i$"), (2.03, up, r"$t_a$"), (7.02, up, r"$v_a$"),
                        (9.83, up, r"$i_a$"), (13.75, _Y - 0.3, r"$\dot{q}_m$"),
                        (15.2, up, r"$q_m$"), (17.0, up, r"$q$"), (8.4, 4.1, r"$v_b$"),
                        (11.95, 3.2, r"$n\tau_L + f_{ec}$"), (6.9, 0.92, r"$p\,q$")):
        d.text(x, y, label)
    return d


PAPER_DIAGRAMS: Mapping[int, Callable[[], Diagram]] = MappingProxyType(
    {2: _motor, 4: _geared, 5: _reflected, 6: _equivalent, 8: _servo})
"""By the paper's number of the figure."""


def block_diagram(number: int) -> Figure:
    """Return a block diagram of the paper.

    Parameters
    ----------
    number : {2, 4, 5, 6, 8}
        The paper's number of the figure.

    Raises
    ------
    InputError
        If it is another.

    Examples
    --------
    >>> bool(block_diagram(2).get_size_inches()[0] > 4.0)
    True
    """
    if number not in PAPER_DIAGRAMS:
        raise InputError("number of the block diagram", got=number,
                         allowed=", ".join(str(known) for known in PAPER_DIAGRAMS))
    return PAPER_DIAGRAMS[number]().figure
