"""A small kit for block diagrams: blocks, summing points, arrows, labels in math text."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.look import COLOURS, context, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
