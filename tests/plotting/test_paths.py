"""Paths of robots in the plane."""

import numpy as np
import pytest

from servotwin import plotting
from servotwin.plotting import PathTrace, robot_paths

CORNERS = np.array([[0.0, 0.0], [0.6, 0.0], [0.6, 0.3]])
DRIVEN = np.array([[0.0, 0.0, 0.0], [0.5, 0.05, 0.2], [0.7, 0.35, 1.5]])


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_each_run_has_a_panel_with_both_paths_and_all_waypoints(count):
    figure = robot_paths([PathTrace(f"run {k}", DRIVEN, DRIVEN - 0.1 * k) for k in range(count)], CORNERS)
    shown = [ax for ax in figure.axes if ax.axison]
    assert [ax.get_title() for ax in shown] == [f"run {k}" for k in range(count)]
    for k, ax in enumerate(shown):
        lines = {line.get_label(): line.get_xydata() for line in ax.lines}
        np.testing.assert_array_equal(lines["waypoints"], CORNERS)
        np.testing.assert_array_equal(lines["driven"], DRIVEN[:, :2])
        np.testing.assert_array_equal(lines["believed"], (DRIVEN - 0.1 * k)[:, :2])
        assert ax.get_aspect() == 1.0
        (low, high), (down, up) = ax.get_xlim(), ax.get_ylim()
        assert low < 0.0 < 0.7 < high
        assert down < 0.0 < 0.35 < up
    assert plotting.to_bytes(figure, "png").startswith(b"\x89PNG")
