"""A filmed angle as a log: beside the servo's command, if a recorder's log has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.bench.video.filmed import Filmed
from servotwin.bench.video.marker import JUMP, LED
from servotwin.errors import InputError, OutputError, OutputExistsError
from servotwin.logs.columns import COMMANDS, SWITCH, TIME, Column
from servotwin.logs.csv_logs import read_log_table
from servotwin.logs.mends import checked_mends, timed
from servotwin.logs.sidecar import FORMAT, read_json, sidecar_path, write_json
from servotwin.parameters import write_file
from servotwin.tables import TextTable, csv_text

ANGLE, SECONDS = "output_angle_deg", "time_s"
_FRAME_PERIOD = 0.02  # s, usual
_SAME = 1e-6  # s: a picture and a row at one time
_AGAINST = -0.3  # correlation of angle and command, below which the sign is asked about
_DELAY = ("where in the exposure a picture's time stands, its rows (rolling shutter) and the LED's picture delay the "
          "angle; leave the delay to the fit")


@dataclass(frozen=True, kw_only=True)
class FilmLog:
    """The written files.

    Parameters
    ----------
    columns : mapping of str to list
        Of the CSV file, cell by cell; "" where there is nothing.
    sidecar : mapping
    remarks : tuple of str
        Remarks for the user.
    """

    columns: Mapping[str, list[Any]]
    sidecar: Mapping[str, Any]
    remarks: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The CSV file."""
        return csv_text(self.columns)


def film_log(filmed: Filmed, log: str | Path | None = None, *, mend: Sequence[str] = ()) -> FilmLog:
    """Return the log of a filmed angle.

    Parameters
    ----------
    filmed : Filmed
    log : str or Path, optional
        CSV file of the recorder, with time and command; its sidecar is taken over. Without it the log has no command.
    mend : sequence of str
        Mends of the log, see `read_logs`.

    Raises
    ------
    InputError
        If the log cannot be read, has no time, no command, or an angle of its own, or hardly overlaps with the clip.

    Notes
    -----
    A fit has no negative delay. So with a log the angle comes later than it was seen: by half a picture, which is
    what the instant of an LED may be off, and after a first jump by one more frame, for which its pulse may have
    waited. The sidecar says by how much.
    """
    if log is None:
        cells = ["" if np.isnan(x) else round(x, 5) for x in np.degrees(filmed.angle).tolist()]
        return FilmLog(columns={SECONDS: [round(t, 6) for t in filmed.time.tolist()], ANGLE: cells},
                       sidecar=_sidecar(filmed, {}, 0.0))
    path = Path(log)
    said = read_json(sidecar_path(path)) if sidecar_path(path).is_file() else {}
    if not isinstance(said, dict) or "columns" in said:
        raise InputError(f"{sidecar_path(path)}: columns", got="said by the sidecar",
                         allowed="a log of `servotwin bench record`, whose header says what is what")
    read = read_log_table(path, checked_mends(mend), {}, needs=(TIME, "command"))
    table, columns, time, command = _time_and_command(read.table, read.layout.columns, mend)
    start, shift = _alignment(filmed, table.cells(columns[command].column), time, said)
    seen = filmed.time + start + shift
    made = _merged(table, columns, time, command, seen, filmed.angle)
    return FilmLog(columns=made, sidecar=_sidecar(filmed, said, shift),
                   remarks=(*table.remarks, *_sign(table, columns[command], command, time, seen, filmed.angle)))


def write_film_log(filmed: Filmed, path: str | Path, *, log: str | Path | None = None, mend: Sequence[str] = (),
                   overwrite: bool = False) -> None:
    """Write a filmed angle as a CSV file and its sidecar, see `film_log`.

    Parameters
    ----------
    filmed : Filmed
    path : str or Path
        Ends in .csv; the sidecar gets the same name with .json.
    log : str or Path, optional
        The recorder's.
    mend : sequence of str
        Mends of the log, see `read_logs`.
    overwrite : bool
        Replace files that are there.

    Raises
    ------
    InputError
        As `film_log` does.
    OutputExistsError, OutputError
        If a file is there, or cannot be written.
    """
    path = Path(path)
    if path.suffix != ".csv":
        raise OutputError(f"{path}", got=path.suffix or "no ending", allowed="a name that ends in .csv")
    made = film_log(filmed, log, mend=mend)
    for file in (path, sidecar_path(path)):
        if file.exists() and not overwrite:
            raise OutputExistsError(file)
    write_json(sidecar_path(path), made.sidecar, overwrite=overwrite)
    write_file(path, made.text.encode(), overwrite=overwrite)


class _Told(NamedTuple):
    table: TextTable
    columns: Mapping[str, Column]
    time: NDArray[np.float64]
    command: str


def _time_and_command(table: TextTable, columns: Mapping[str, Column], mend: Sequence[str]) -> _Told:
    command = next(name for name in COMMANDS if name in columns)
    if "output_angle" in columns:
        raise InputError(f"{table.path}: column", got=columns["output_angle"].column,
                         allowed="a log without an angle, which the clip is to give")
    parts = timed(table, columns[TIME], mend)
    if len(parts) > 1:
        raise InputError(f"{table.path}", got=f"{len(parts)} logs, as its clock begins again",
                         allowed="the one log of the clip, in a file of its own")
    return _Told(parts[0].table, columns, parts[0].time, command)


def _alignment(filmed: Filmed, cells: list[str], time: NDArray[np.float64], said: Mapping[str, Any],
               ) -> tuple[float, float]:
    """Return when in the log the clip's instant was, and by how much later the angle is said to be [s]."""
    if filmed.instant.kind == LED:
        return 0.0, 0.5 * filmed.interval
    if filmed.instant.kind != JUMP:
        return 0.0, 0.0
    turn = next((k for k in range(1, len(cells)) if cells[k] != cells[k - 1]), None)
    if turn is None:
        raise InputError("first jump of the command", got="a command that never changes",
                         allowed="a log in which it does, or --instant led")
    period = said.get("parameters", {}).get("electronics.frame_period", _FRAME_PERIOD)
    return float(time[turn]), float(period) + 0.5 * filmed.interval


def _merged(table: TextTable, columns: Mapping[str, Column], time: NDArray[np.float64], command: str,
            seen: NDArray[np.float64], angle: NDArray[np.float64]) -> dict[str, list[Any]]:
    """Return all rows of the log in which something happens, and all pictures between its first and its last one."""
    told = [columns[name].column for name in (command, SWITCH) if name in columns]
    others = [name for name in table.header if name != columns[TIME].column]
    cells = {name: table.cells(name) for name in others}
    rows: list[tuple[float, dict[str, Any]]] = [
        (float(time[k]), {name: cells[name][k] for name in others}) for k in range(len(time))
        if k in (0, len(time) - 1) or any(cells[name][k] != cells[name][k - 1] for name in told)
        or any(cells[name][k] for name in others if name not in told)]
    inside = np.flatnonzero((seen >= time[0] - _SAME) & (seen <= time[-1]) & np.isfinite(angle))
    if inside.size < 3:
        raise InputError(f"{table.path}: pictures with the mark between its first and last row", got=int(inside.size),
                         allowed="3 or more; is the clip that of this log, and its instant the right one?")
    row_times = np.array([at for at, _ in rows])
    for k in inside.tolist():
        shown = {ANGLE: round(float(np.degrees(angle[k])), 5)}
        near = int(np.argmin(np.abs(row_times - seen[k])))
        if abs(row_times[near] - seen[k]) <= _SAME:
            rows[near][1].update(shown)
            continue
        now = int(np.searchsorted(time, seen[k], side="right")) - 1
        rows.append((float(seen[k]), {**{name: cells[name][now] for name in told}, **shown}))
    rows.sort(key=lambda row: row[0])
    return {SECONDS: [round(at, 9) for at, _ in rows],
            **{name: [row.get(name, "") for _, row in rows] for name in (*others, ANGLE)}}


def _sidecar(filmed: Filmed, said: Mapping[str, Any], shift: float) -> dict[str, Any]:
    video = {**filmed.facts, "angle_later_by_s": round(shift, 6), "delay": _DELAY}
    source = f"angle from the clip {filmed.facts['file']}"
    before = said.get("source")
    return {"format": FORMAT, **said, "source": f"{before}; {source}" if before else source,
            "conditions": {**said.get("conditions", {}), "angle": "video"},
            "recorded": {**said.get("recorded", {}), "video": video}}


def _sign(table: TextTable, column: Column, command: str, time: NDArray[np.float64], seen: NDArray[np.float64],
          angle: NDArray[np.float64]) -> tuple[str, ...]:
    """Return a remark where the angle falls while the command grows."""
    told = column.to_si(table.numbers(column.column, missing=np.nan), command)
    held = told[np.clip(np.searchsorted(time, seen, side="right") - 1, 0, len(time) - 1)]
    both = np.isfinite(held) & np.isfinite(angle)
    if both.sum() < 3 or np.ptp(held[both]) == 0.0 or np.ptp(angle[both]) == 0.0:
        return ()
    if np.corrcoef(held[both], angle[both])[0, 1] > _AGAINST:
        return ()
    return ("the angle falls where the command grows: --flip counts the other way",)
