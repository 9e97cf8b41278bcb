"""Servos in trainers of policies: in all worlds of MuJoCo Warp, and as the actuators of packages that stand on it."""
