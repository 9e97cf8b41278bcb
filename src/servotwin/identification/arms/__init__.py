"""The servos of whole robots, from what was recorded of their joints."""

from servotwin.identification.arms.arm_fit import ArmCause, ArmFit
from servotwin.identification.arms.identify_arm import identify_arm

__all__ = ["ArmCause", "ArmFit", "identify_arm"]
