"""Logs of the maker's tester: JSON with a time step [ms], and targets and angles [deg]."""

import numpy as np

from servotwin.logs import Log, LogFormat

FORMAT = LogFormat("logs of Acme's tester (JSON)", "json", "acme_servos.logs")


def recognises(content):
    """Return whether a content is such a log."""
    return isinstance(content, dict) and content.get("tester") == "acme"


def logs_of(file, content):
    """Return the log of a file."""
    angle = np.radians(content["angle_deg"])
    return [Log(name=file.stem, time=1e-3 * content["step_ms"] * np.arange(len(angle)),
                command=np.radians(content["target_deg"]), command_kind="angle", measured={"output_angle": angle},
                source=str(file))]
