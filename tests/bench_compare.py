"""Benches of the page as one file and of the server compared: the same numbers and words."""

import warnings

import numpy as np

from bench_scenes import by_python, drawn
from servotwin.web.live import LiveBench, read_scene
from servotwin.web.live.live_bench import NOT_AT_REST

ANGLE = 1e-9  # rad
BETWEEN = 1e-8  # s: where a drive ends as the next begins, rounding decides whether the bridge is off in between
SAME = 1e-11  # s: of two rows
LEAST, FLAT = 2e-6, 1e-5  # V, s: within which a least voltage is found
OTHER = 1e-6  # of the peak of a signal: rates that two libraries of functions, under an integrator, leave


def whole(value):
    """Return a value as it comes from a page, which writes 2.0 as 2."""
    if isinstance(value, dict | list):
        inner = value.items() if isinstance(value, dict) else enumerate(value)
        made = {key: whole(one) for key, one in inner}
        return made if isinstance(value, dict) else list(made.values())
    return int(value) if isinstance(value, float) and value == int(value) else value


def alone(rows, others):
    """Return rows at times that these and other rows have once."""
    kept = []
    for table in (rows, others):
        apart = np.diff(table[:, 0], prepend=-1.0, append=1e9)
        kept.append(table[np.minimum(apart[:-1], apart[1:]) > BETWEEN])
    at = np.searchsorted(kept[1][:, 0], kept[0][:, 0] - BETWEEN)
    near = np.abs(kept[1][np.minimum(at, len(kept[1]) - 1), 0] - kept[0][:, 0]) < BETWEEN
    return kept[0][near]


def but_flat(ours, theirs, names, seed):
    """Return rows at the same times: where a supply is least its voltage is flat, and rounding says when that is."""
    same = np.abs(ours[:, 0] - theirs[:, 0]) < SAME
    if not same.all():
        off = np.abs(ours - theirs)[~same]
        assert off[:, names.index("bus_voltage")].max() < LEAST, seed
        assert off[:, 0].max() < FLAT, seed
    return ours[same], theirs[same]


def shared(ours, theirs):
    """Return events that both sides have, in pairs."""
    left, found = list(theirs), []
    for one in ours:
        other = next((two for two in left if two[1:] == one[1:] and abs(two[0] - one[0]) < 1e-6), None)
        if other is not None:
            left.remove(other)
            found.append((one, other))
    return found


def compare(benches, seeds, draw=drawn):
    """Let benches go on both ways and compare what shows, what happened, and what was refused.

    `benches` makes of jobs what shows of each at the page as one file.
    """
    jobs = [{**job, "steps": [{**step, "value": whole(step.get("value"))} for step in job["steps"]]}
            for job in map(draw, seeds)]
    refused = moved = 0
    for seed, job, page in zip(seeds, jobs, benches(jobs), strict=True):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            server = by_python(job)
            columns = LiveBench(read_scene(job["scene"])).columns
        assert page["refused"] == server["refused"], seed
        refused += len(server["refused"])
        for names, ours, theirs in zip(columns, page["rows"], server["rows"], strict=True):
            ours, theirs = (np.array(rows, np.float64) for rows in (ours, theirs))
            if ours.shape != theirs.shape:  # a look at the very tick of a program: rounding decides if it is seen twice
                assert abs(len(ours) - len(theirs)) <= 2, seed
                ours, theirs = alone(ours, theirs), alone(theirs, ours)
                assert ours.shape == theirs.shape, seed
            ours, theirs = but_flat(ours, theirs, names, seed)
            off, at = np.abs(ours - theirs), names.index("output_angle")
            assert off[:, at].max() < ANGLE, seed
            bad = (off / np.maximum(np.abs(theirs).max(axis=0), 1e-3)).max(axis=1) >= OTHER
            apart = np.diff(theirs[:, 0], prepend=-1.0, append=1e9)
            assert not bad[np.minimum(apart[:-1], apart[1:]) > BETWEEN].any(), seed
            assert bad.sum() <= max(2, len(ours) // 5), seed  # which of two programs ticks first, rounding says
            moved += np.ptp(theirs[:, at]) > 0.01
        for ours, theirs in zip(page["pulses"], server["pulses"], strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-12, err_msg=str(seed))
        happened = [event for event in server["events"] if not event[1].startswith(NOT_AT_REST)]
        ours, theirs = (sorted(map(tuple, events), key=lambda one: (one[1], one[2], one[0])) for events in (
            page["events"], happened))
        if len(ours) != len(theirs):  # of a shaft that only just turns back rounding decides whether it does
            same = shared(ours, theirs)
            assert len(ours) + len(theirs) - 2 * len(same) <= 2, seed
            ours, theirs = ([pair[k] for pair in same] for k in (0, 1))
        assert [one[1:] for one in ours] == [one[1:] for one in theirs], seed
        np.testing.assert_allclose([one[0] for one in ours], [one[0] for one in theirs], atol=1e-6)
        assert read_scene(page["text"]) == read_scene(server["text"]), seed
    return refused, moved
