"""The bar chart of what the terms cost."""

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from servos import PLAIN, written

HERE = Path(__file__).resolve().parent


def draw(batch: dict[str, float], single: dict[str, float]) -> None:
    """Save both factors of every term, the dearest at the top."""
    names = sorted((name for name in batch if name != PLAIN.name), key=batch.__getitem__)
    at = np.arange(len(names))
    figure, axes = plt.subplots(figsize=(8.0, 5.0), layout="constrained")
    for shift, factor, hatch, label in ((0.2, batch, "", "in a batch, compiled"),
                                        (-0.2, single, "///", "one servo, plain Python")):
        values = [factor[name] for name in names]
        bars = axes.barh(at + shift, values, 0.4, hatch=hatch, edgecolor="white", label=label)
        axes.bar_label(bars, [written(x) for x in values], padding=3)
    axes.set(xscale="log", yticks=at, yticklabels=names, xlabel="time over that of the plain pulse servo [1]")
    axes.set_xlim(0.5, 3.0 * max(*batch.values(), *single.values()))
    axes.axvline(1.0, color="black", linewidth=0.8)
    axes.grid(axis="x", which="major", alpha=0.4)
    axes.set_axisbelow(True)
    axes.legend(loc="lower right")
    figure.savefig(HERE / "cost.png", dpi=120)
    plt.close(figure)
    print(f"picture: {HERE.name}/cost.png")
