"""Draw the wiring of the bench again: run this file."""

from pathlib import Path

from matplotlib.patches import Rectangle

from servotwin import plotting
from servotwin.look import COLOURS, context, new_figure

IMAGES = Path(__file__).resolve().parents[1] / "images"
INK = COLOURS["black"]


def box(axes, x, y, width, height, title, pins=None, *, right=True):
    """Draw a part, with pins at their heights on one side."""
    axes.add_patch(Rectangle((x, y), width, height, facecolor="white", edgecolor=INK, linewidth=1.2))
    if pins is None:
        axes.text(x + width / 2, y + height / 2, title, ha="center", va="center", fontsize=8.5)
        return
    axes.text(x + width / 2, y + height - 0.12, title, ha="center", va="top", fontsize=9.5, weight="bold")
    for pin, at in pins.items():
        axes.text(x + (width - 0.1 if right else 0.1), at, pin, fontsize=8.5, va="center",
                  ha="right" if right else "left")


def wire(axes, colour, *points):
    """Draw a wire through points."""
    xs, ys = zip(*points, strict=True)
    axes.plot(xs, ys, color=COLOURS[colour], linewidth=1.8, solid_capstyle="round", zorder=0)


def note(axes, x, y, text):
    """Say what a wire carries."""
    axes.text(x, y + 0.08, text, fontsize=8, ha="center", va="bottom")


def wiring():
    """The board, the servo, and all between them."""
    figure = new_figure(9.0, 5.4, layout=None)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 15.0), ylim=(0.0, 9.0))
    axes.axis("off")
    box(axes, 0.4, 0.6, 2.6, 8.0, "Nano or Uno", {
        "D9": 7.6, "A0": 6.7, "A1": 5.2, "A2": 4.3, "A3": 3.4, "AREF": 2.5, "5V": 1.7, "GND": 0.95})
    box(axes, 11.8, 5.0, 2.8, 3.6, "servo", {"signal": 7.6, "tap": 6.7, "+": 5.8, "GND": 5.25}, right=False)
    box(axes, 11.8, 0.6, 2.8, 2.2, "servo supply", {"+": 1.9, "GND": 0.95}, right=False)

    wire(axes, "blue", (3.0, 7.6), (11.8, 7.6))
    box(axes, 5.2, 7.35, 1.5, 0.5, "330 Ω")
    note(axes, 9.0, 7.6, "pulse")
    wire(axes, "orange", (3.0, 6.7), (11.8, 6.7))
    box(axes, 5.2, 6.45, 1.5, 0.5, "1 kΩ")
    note(axes, 9.0, 6.7, "potentiometer's tap")

    wire(axes, "vermilion", (11.8, 5.8), (10.4, 5.8), (10.4, 1.9), (11.8, 1.9))
    box(axes, 9.5, 3.0, 1.8, 0.9, "0.05 Ω and\nINA180A1")
    wire(axes, "green", (3.0, 5.2), (9.2, 5.2), (9.2, 3.45), (9.5, 3.45))
    note(axes, 6.0, 5.2, "current, 1 V/A")
    wire(axes, "purple", (3.0, 4.3), (8.7, 4.3), (10.4, 4.3))
    box(axes, 7.0, 4.05, 1.4, 0.5, "30 kΩ")
    wire(axes, "black", (6.3, 4.3), (6.3, 0.95))
    box(axes, 5.75, 2.9, 1.1, 0.8, "10 kΩ")
    note(axes, 4.4, 4.3, "supply / 4")
    wire(axes, "sky", (3.0, 3.4), (3.7, 3.4))
    axes.text(3.8, 3.4, "knob (paper)", fontsize=8, va="center")
    wire(axes, "grey", (3.0, 2.5), (4.6, 2.5), (4.6, 0.95))
    box(axes, 4.15, 1.2, 0.9, 0.7, "TL431")
    wire(axes, "grey", (3.0, 1.7), (3.55, 1.7), (3.55, 2.5))
    box(axes, 3.15, 1.95, 0.8, 0.4, "1 kΩ")
    wire(axes, "black", (3.0, 0.95), (11.8, 0.95))
    wire(axes, "black", (11.5, 0.95), (11.5, 5.25), (11.8, 5.25))
    for x in (4.6, 6.3, 11.5):
        axes.plot(x, 0.95, "o", color=INK, markersize=4)
    for x, y in ((6.3, 4.3), (3.55, 2.5), (10.4, 4.3)):
        axes.plot(x, y, "o", color=INK, markersize=4)
    note(axes, 8.6, 0.3, "one ground, joined at the supply")
    return figure


def main():
    with context():
        plotting.save(wiring(), IMAGES / "bench_wiring.png", overwrite=True)


if __name__ == "__main__":
    main()
