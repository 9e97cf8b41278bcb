"""On what the acceleration depends through a term: flags, which `|` unites.

Dependence on the speed in a straight line is not told: every solution has it.
"""

from __future__ import annotations

ON_Q, ON_I = 1, 2  # in a straight line: on the angle, on a current with inertia
CURVED_Q, CURVED_W, CURVED_T = 4, 8, 16  # on angle, speed and time
STEEP_W = 32  # on the speed, and much of it within a short range
ON_HEAT = 64  # on temperatures
TWO_BODIES = 128  # motor and output move apart
FADING = 512  # on the speed, in no straight line while the shaft creeps
BY_SHARE = 256  # on the torques through the gear, in a straight line as long as the share keeps its sign
