"""Servos at the joints of one MuJoCo model: how each is mounted, and what all of them do at a tick."""
