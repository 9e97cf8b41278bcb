"""Pictures: results over time, straight lines through data, pulses, and the paper's block diagrams.

Everything is drawn with matplotlib's objects and without its global state; matplotlib is loaded when a picture is
asked for. Angles are in degrees and pulses in microseconds. A picture of more than it can show at once has pages, as
even as possible: `page=2` draws the second, and `pages` says which there are.
"""

from servotwin.look import COLOURS, CURVES_A_PAGE, LINES, axes_grid, finished, pages, readable, to_bytes
from servotwin.plotting.block_diagrams import PAPER_DIAGRAMS, Diagram, Formula, block_diagram, formula_svg
from servotwin.plotting.bode import LOOPS_A_PAGE, Response, bode, loop_curve, root_locus
from servotwin.plotting.files import save
from servotwin.plotting.panels import (
    Curve,
    JointUse,
    Limit,
    ToolTrace,
    bandwidth_curves,
    compared_curves,
    curves,
    holding_curves,
    joint_use,
    lift_curve,
    pulses,
    ranking,
    speed_curves,
    tool_paths,
)
from servotwin.plotting.responses import SHOWN, Shown, log_over_time, metric_shown, shown, time_response, tornado
from servotwin.plotting.robots import (
    JOINTS_A_PAGE,
    PATHS_A_PAGE,
    Cloud,
    JointTrace,
    PathTrace,
    ReplayTrace,
    ServoTrace,
    ShaftTrace,
    joint_tracking,
    replay_windows,
    robot_paths,
    servo_electrics,
    shaft_torques,
)

__all__ = [
    "COLOURS",
    "CURVES_A_PAGE",
    "JOINTS_A_PAGE",
    "LINES",
    "LOOPS_A_PAGE",
    "PAPER_DIAGRAMS",
    "PATHS_A_PAGE",
    "SHOWN",
    "Cloud",
    "Curve",
    "Diagram",
    "Formula",
    "JointTrace",
    "JointUse",
    "Limit",
    "PathTrace",
    "ReplayTrace",
    "Response",
    "ServoTrace",
    "ShaftTrace",
    "Shown",
    "ToolTrace",
    "axes_grid",
    "bandwidth_curves",
    "block_diagram",
    "bode",
    "compared_curves",
    "curves",
    "finished",
    "formula_svg",
    "holding_curves",
    "joint_tracking",
    "joint_use",
    "lift_curve",
    "log_over_time",
    "loop_curve",
    "metric_shown",
    "pages",
    "pulses",
    "ranking",
    "readable",
    "replay_windows",
    "robot_paths",
    "root_locus",
    "save",
    "servo_electrics",
    "shaft_torques",
    "shown",
    "speed_curves",
    "time_response",
    "to_bytes",
    "tool_paths",
    "tornado",
]
