"""Results are what they were: 500 random servos, one by one, in lanes, and on a bus, to 1e-11.

That is of the largest number of a signal in a case, or of 1 where that is larger; `frozen_search.py` says which cases
are allowed more, those that rounding alone moves. `frozen_servos.py` says what is frozen, and when it may be written
anew.
"""

import numpy as np
import pytest

from models.frozen_servos import (
    BUSES,
    FILE,
    SIGNALS,
    bus_features,
    bus_of,
    case_of,
    described,
    is_batched,
    moves,
    plan,
    run,
    run_bus,
    run_lanes,
)

SINGLE = 1e-5  # rad, of angles in float32
KEPT = ("signals", "last", "events", "status", "allowed", "last_allowed")
SCATTER = 10.0  # what rounding moves, it moves by so much more another time, or on another make of CPU
BY_STRIDES, STEPPED = ("heat", "spring", "pendulum"), 1e-10  # lanes that take steps of their own, and by how much
SHOWN = 10  # cases of a failure
GROUPS = 8  # tests of each kind
ANGLE, BUS_VOLTAGE = SIGNALS.index("output_angle"), SIGNALS.index("bus_voltage")


@pytest.fixture(scope="module")
def frozen():
    with np.load(FILE) as file:
        return dict(file)


def group(k):
    """Return the numbers of the cases of a group; the slow ones are spread."""
    return range(k, len(plan()), GROUPS)


def scattered(allowed):
    """Return the allowances, with room for how another machine rounds."""
    return SCATTER * allowed


def compared(name, time, before, after, allowed):
    """Return a line for every signal (18, times) that is not what it was, with where it differs most."""
    moved, allowed = moves(before, after), scattered(allowed)
    for row in np.flatnonzero(~(moved.max(axis=-1) <= allowed)):
        k = int(np.argmax(moved[row]))
        yield (f"{name}: {SIGNALS[row]} at {time[k]:.6f} s is {after[row, k]:.15g}, was {before[row, k]:.15g} "
               f"(moved by {moved[row, k]:.1e}, allowed {allowed[row]:.1e})")


def differences(name, time, before, after):
    """Return a line for all that is not what it was: signals, the end, the count of events, and the status."""
    for what in ("events", "status"):
        if getattr(after, what) != before[what]:
            yield f"{name}: {what} {getattr(after, what)}, was {before[what]}"
    yield from compared(name, time, before["signals"], after.signals, before["allowed"])
    moved = moves(before["last"][:, None], after.last[:, None])[:, 0]
    for k in np.flatnonzero(~(moved <= scattered(before["last_allowed"]))):
        yield (f"{name}: last {('angle', 'speed')[k]} is {after.last[k]:.15g}, was {before['last'][k]:.15g} "
               f"(moved by {moved[k]:.1e}, allowed {before['last_allowed'][k]:.1e})")


def fail_of(cases):
    """Fail with one line for each case that has differences; `cases` are the lines of each."""
    bad = [lines for lines in map(list, cases) if lines]
    if bad:
        shown = [lines[0] + (f", and {len(lines) - 1} more of this case" if len(lines) > 1 else "")
                 for lines in bad[:SHOWN]]
        more = f"\n... and {len(bad) - SHOWN} more cases" if len(bad) > SHOWN else ""
        pytest.fail(f"{len(bad)} cases differ from {FILE.name}\n" + "\n".join(shown) + more, pytrace=False)


def one_by_one(frozen, n):
    """Return a line for all that differs of a case."""
    draw, time = frozen["draw"][n], frozen["time"][n]
    yield from differences(described(n, draw), time, {name: frozen[name][n] for name in KEPT},
                           run(case_of(n, draw), time)[0])


def in_a_lane(frozen, n):
    """Return a line for all that differs of a case in a lane."""
    draw, time = frozen["draw"][n], frozen["time"][n]
    name, one = f"lane of {described(n, draw)}", case_of(n, draw)
    now, status = run_lanes(one, time)
    if status[0] != frozen["batch_status"][n]:
        yield f"{name}: status {status[0]}, was {frozen['batch_status'][n]}"
    stepped = STEPPED if any(term in name for term in BY_STRIDES) else 0.0
    yield from compared(name, time, frozen["batch"][n], now[0], np.maximum(frozen["batch_allowed"][n], stepped))
    if np.isfinite(frozen["single"][n]).all():  # where float32 is as good as that
        off = np.max(np.abs(run_lanes(one, time, "float32")[0][0, ANGLE] - frozen["single"][n]))
        if not off <= SINGLE:
            yield f"{name}: output_angle of float32 moved by {off:.1e} rad, allowed {SINGLE:.1e}"


def in_a_lane_as_alone(frozen, n):
    """Return a line for all that differs of a case whose model's lanes are not frozen: in a lane from one by one."""
    draw, time = frozen["draw"][n], frozen["time"][n]
    now, status = run_lanes(case_of(n, draw), time)
    name = f"lane of {described(n, draw)}"
    if status[0] != frozen["status"][n]:
        yield f"{name}: status {status[0]}, was {frozen['status'][n]}"
    yield from compared(name, time, frozen["signals"][n], now[0], frozen["allowed"][n])


def on_a_bus(frozen, n):
    """Return a line for all that differs of a bus."""
    draw, time = frozen["bus_draw"][n], frozen["bus_time"][n]
    now, voltage, _ = run_bus(bus_of(n, draw), time)
    for j, ((model, features), one) in enumerate(zip(bus_features(n), now, strict=True)):
        name = f"bus {n}, servo {j} ({model}: {', '.join(features)}; draw {draw})"
        yield from differences(name, time, {name: frozen[f"bus_{name}"][n, j] for name in KEPT}, one)
    moved = moves(frozen["bus_voltage"][n], voltage).max()
    if not moved <= np.nanmax(frozen["bus_allowed"][n, :, BUS_VOLTAGE]):
        yield f"bus {n} (draw {draw}): voltage of the bus moved by {moved:.1e}"


def test_the_file_has_all_cases(frozen):
    assert len(frozen["draw"]) == len(plan()) == 500
    assert len(frozen["bus_draw"]) == BUSES


@pytest.mark.long
@pytest.mark.parametrize("k", range(GROUPS))
def test_one_by_one(frozen, k):
    fail_of(one_by_one(frozen, n) for n in group(k))


@pytest.mark.long
@pytest.mark.parametrize("k", range(GROUPS))
def test_in_lanes(frozen, k):
    fail_of(in_a_lane(frozen, n) for n in group(k) if is_batched(n))


@pytest.mark.long
@pytest.mark.parametrize("k", range(GROUPS))
def test_motors_and_averaged_servos_in_lanes(frozen, k):
    fail_of(in_a_lane_as_alone(frozen, n) for n in group(k) if not is_batched(n))


@pytest.mark.long(but="0")
@pytest.mark.parametrize("k", range(4))
def test_on_a_bus(frozen, k):
    fail_of(on_a_bus(frozen, n) for n in range(k, BUSES, 4))
