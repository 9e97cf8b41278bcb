"""Pictures of tools' paths and of redundant joints: what is drawn, in which units."""

import numpy as np
import pytest

from servotwin import plotting

TIME = np.linspace(0.0, 1.0, 50)
LINE = np.stack([0.2 + 0.0 * TIME, 0.1 * TIME, 0.04 * TIME], axis=1)


def test_a_path_is_drawn_in_the_plane_in_which_it_is():
    trace = plotting.ToolTrace("servos", TIME, LINE + np.array([0.0, 0.0, 0.001]), np.full(50, 0.001))
    left, right = plotting.tool_paths(LINE, [trace]).axes
    assert (left.get_xlabel(), left.get_ylabel()) == ("y (mm)", "z (mm)")
    np.testing.assert_allclose(left.lines[1].get_ydata(), 40.0 * TIME + 1.0)
    np.testing.assert_allclose(right.lines[0].get_ydata(), 1.0)


def test_joints_are_drawn_between_their_limits_with_their_torques():
    use = plotting.JointUse("none", np.array([[-0.5, 0.0], [0.25, 0.5]]), np.array([0.1, 0.2]))
    left, right = plotting.joint_use(["shoulder", "elbow"], [use]).axes
    bars = [bar.get_bbox().bounds for bar in left.patches]
    assert [(bar[1], bar[1] + bar[3]) for bar in bars] == [pytest.approx((-0.5, 0.25)), pytest.approx((0.0, 0.5))]
    assert [bar.get_height() for bar in right.patches] == pytest.approx([100.0, 200.0])  # mN m
