"""What is wrong with logs before any fit: turned signs, wrapped angles, wrong stamps, commands that were not followed.

None of these checks fits a parameter or runs a simulation, and nothing is mended unless the caller asks for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from servotwin.errors import InputError
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.suspicions.centre import centred
from servotwin.identification.fitting.suspicions.followed import not_followed
from servotwin.identification.fitting.suspicions.look import Finding, Look, look
from servotwin.identification.fitting.suspicions.pulses import refused
from servotwin.identification.fitting.suspicions.sign import turned
from servotwin.identification.fitting.suspicions.span import spans
from servotwin.identification.fitting.suspicions.stamps import missing_rows, wrong_stamps
from servotwin.identification.fitting.suspicions.wrap import wraps
from servotwin.logs.log import Log
from servotwin.models import Model

__all__ = ["BY_ITSELF", "KINDS", "MENDED", "Finding", "Mended", "explained", "findings", "first_looks", "mended"]

_CHECKS: Mapping[str, Callable[[Sequence[Look]], list[Finding]]] = {
    "wrap": wraps, "stamps": wrong_stamps, "sign": turned, "span": spans, "rows": missing_rows,
    "not followed": not_followed, "pulses": refused,
}  # each looks at logs that the ones before have put right
KINDS = tuple(_CHECKS)
_STEADIED = ("wrap", "stamps")  # what makes a shaft look faster than any servo
MENDED = tuple(kind for kind in KINDS if kind != "pulses")
"""Kinds of findings that can be mended."""
BY_ITSELF = ("wrap", "sign")
"""Kinds that a fit mends unasked, as no servo does so and nothing is lost: a search would be in vain."""


def findings(logs: Sequence[Log], model: Model) -> tuple[Finding, ...]:
    """Return what is probably wrong with logs, without fitting anything.

    Parameters
    ----------
    logs : sequence of Log
    model : Model
        Over the servo that the logs are of; its calibration, speed and stops count, by a wide margin.

    Returns
    -------
    tuple of Finding
        In the order of `KINDS`. The mended log of a finding has the kinds before it mended too.

    Examples
    --------
    >>> import numpy as np, servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb")
    >>> run = st.simulate(st.PulseServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0,
    ...                   output_step=0.02)
    >>> log = Log(name="step", time=run.time, command=run["pulse_width"], command_kind="pulse_width",
    ...           measured={"output_angle": -run["output_angle"]})
    >>> [one.kind for one in findings([log], st.PulseServo(servo))]
    ['sign']
    """
    return _checked(logs, model, KINDS).findings


class Mended(NamedTuple):
    """Logs with some kinds of findings mended, and the findings that were."""

    logs: tuple[Log, ...]
    findings: tuple[Finding, ...]


class _Checked(NamedTuple):
    """Logs with all that is found mended, what is found, and the logs with jumps and stamps mended only."""

    logs: tuple[Log, ...]
    findings: tuple[Finding, ...]
    steadied: tuple[Log, ...]


def mended(logs: Sequence[Log], model: Model, kinds: Sequence[str]) -> Mended:
    """Return logs with these kinds of findings mended, in the order of `KINDS`."""
    done = _checked(logs, model, [kind for kind in KINDS if kind in kinds])
    return Mended(done.logs, tuple(one for one in done.findings if one.mended is not None))


def _checked(logs: Sequence[Log], model: Model, kinds: Sequence[str]) -> _Checked:
    """Check logs for some kinds of findings, one kind after the other."""
    found: list[Finding] = []
    looks = {log.name: look(log, model) for log in logs} if kinds else {}
    now = {log.name: log for log in logs}
    steadied = tuple(logs)
    for kind in kinds:
        for one in (seen := _CHECKS[kind]([one for one in looks.values() if one is not None and one.counts.any()])):
            if one.mended is not None:
                now[one.log] = one.mended
                looks[one.log] = look(one.mended, model)
        found += seen
        if kind in _STEADIED:
            steadied = tuple(now.values())
    return _Checked(tuple(now.values()), tuple(found), steadied)


def first_looks(logs: Sequence[Log], model: Model, mend: Sequence[str],
                unasked: Sequence[str] = ()) -> tuple[tuple[Log, ...], tuple[str, ...]]:
    """Return logs with some kinds of findings mended, asked for or not, and what has to be said of all findings.

    Raises
    ------
    InputError
        If a kind is unknown, a command lies beyond the travel, whatever its zero, or a shaft turns faster than the
        servo could by far and no finding says why.
    """
    kinds = checks.checked_words("mend", mend, MENDED)
    about = centred(logs, model)
    done = mended(about.logs, model, (*kinds, *unasked))
    left = _checked(done.logs, model, KINDS)
    checks.check_speeds(left.steadied, model)
    return done.logs, (*about.sentences, *(f"mended: {one.sentence}" for one in done.findings),
                       *(one.sentence for one in left.findings))


@contextmanager
def explained(noticed: Sequence[str]) -> Iterator[None]:
    """Add what was noticed first to an error that it may be the cause of."""
    try:
        yield
    except InputError as error:
        if not noticed:
            raise
        raise InputError(f"{error}; {noticed[0]}") from None
