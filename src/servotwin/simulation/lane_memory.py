"""What servos that run side by side remember, as records that the general way goes on from, and back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.memory import BEAT, FIRST_STEP, SAME, Memory
from servotwin.models.engine.records import TILE, record_of

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

RECORD = record_of(Memory)


def flat(tiles: NDArray[Any], group: str, name: str) -> Any:
    """Return a copy of a number of all lanes in tiles, one after the other."""
    return tiles[group][name].ravel()


def put(tiles: NDArray[Any], group: str, name: str, places: Indices, values: Any) -> None:
    """Set a number of the lanes at these places of tiles."""
    tiles[group][name][places // TILE, places % TILE] = values


def records_of(tiles: NDArray[Any], places: Indices, temperatures: Floats) -> NDArray[Any]:
    """Return what the lanes at these places of tiles remember; temperatures (2, n) are constant there [K]."""
    records = np.zeros(len(places), RECORD)
    servo, clock, count = ({name: flat(tiles, group, name)[places].astype(np.float64) for name in names}
                           for group, names in _READ.items())
    regular = count["edges"] < 0
    now = np.where(regular, clock["since"] - clock["length"], clock["edge"] + clock["since"])
    records["frames"] = np.where(regular, count["number"], 0)
    records["beat"] = np.where(regular, clock["period"], BEAT)
    records["u_end"] = records["tau_end"] = math.inf
    point, chip = records["point"], records["chip"]
    point["time"], point["anchor_time"], point["step"] = now, math.inf, FIRST_STEP
    for column, values in enumerate((servo["q"], servo["w"], 0.0, *temperatures, servo["q"], servo["w"])):
        point["y"][:, column] = values
    point["anchor"] = point["y"]
    point["wiper"] = np.where(flat(tiles, "hung", "half_slack")[places] > 0.0, servo["wiper"], servo["q"])
    chip["number"], chip["draws"] = count["number"], count["first_draw"] + count["number"]
    chip["drive"], chip["error"] = servo["drive"], servo["error"]
    chip["drive_end"] = np.where(servo["drive"] != 0.0, now + servo["left"], math.inf)
    chip["clock"] = now + servo["silence"]
    for decision, before in (("pending", ""), ("later", "later_")):
        chip[decision]["time"] = now + servo[f"{before}due"]
        chip[decision]["sign"], chip[decision]["duration"] = servo[f"{before}sign"], servo[f"{before}duration"]
        chip[decision]["error"] = servo[f"{before}decided"]
    return records


def put_records(tiles: NDArray[Any], places: Indices, records: NDArray[Any], period: Floats) -> None:
    """Put what lanes remember back into tiles; their frames are regular, of these periods from now on [s]."""
    point, chip = records["point"], records["chip"]
    now, beat = point["time"], records["beat"]
    time = records["frames"] * beat + now
    same = beat == period
    number = np.where(same, chip["number"], np.ceil(time / period - SAME).astype(np.int64))
    to_next = np.where(same, (chip["number"] - records["frames"]) * beat - now, number * period - time)
    to_next = np.maximum(to_next, 0.0)
    values: dict[str, dict[str, Any]] = {
        "servo": {"q": point["y"][:, 0], "w": point["y"][:, 1], "wiper": point["wiper"],
                  "drive": chip["drive"], "error": chip["error"],
                  "left": np.where(chip["drive"] != 0.0, chip["drive_end"] - now, 0.0), "silence": chip["clock"] - now},
        "clock": {"edge": (number - 1) * period, "since": period - to_next, "length": period, "period": period},
        "count": {"number": number, "first_draw": chip["draws"] - number}}
    for decision, before in (("pending", ""), ("later", "later_")):
        waits = chip[decision]
        values["servo"] |= {f"{before}due": waits["time"] - now, f"{before}sign": waits["sign"],
                            f"{before}duration": waits["duration"], f"{before}decided": waits["error"]}
    for group, columns in values.items():
        for name, column in columns.items():
            put(tiles, group, name, places, column)


_READ = {
    "servo": ("q", "w", "wiper", "drive", "left", "silence", "error", "due", "sign", "duration", "decided", "later_due",
              "later_sign", "later_duration", "later_decided"),
    "clock": ("since", "length", "edge", "period"),
    "count": ("number", "first_draw", "edges"),
}
