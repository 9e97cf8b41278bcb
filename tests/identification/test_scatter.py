"""The noise of residuals, where a servo mostly rests, and with gross outliers."""

import numpy as np
import pytest

import servotwin as st
from identification.fits import FREE, fitted, near, some
from servotwin.errors import InputError
from servotwin.identification import Space
from servotwin.identification.fitting.search.case import make_case
from servotwin.identification.fitting.search.least_squares import moving, scatter

COUNT = 2000


def residuals(kind):
    """Return residuals, and where the servo moves: a fifth of the time."""
    rng = np.random.default_rng(7)
    white, moves = rng.standard_normal(COUNT), np.arange(COUNT) % 100 < 20
    share = float(kind.split()[0]) / 100.0 if "outliers" in kind else 0.0
    hit = rng.random(COUNT) < share
    if kind == "counts":
        return np.round(2.0 * rng.random(COUNT)) - 2.0 * rng.random(COUNT), moves
    if "model" in kind:
        white = np.where(moves, 20.0, 1.0) * white
    return np.where(hit, rng.choice([-1000.0, 1000.0], COUNT), white), moves


@pytest.mark.parametrize(("kind", "lowest", "highest"), [
    ("white", 0.95, 1.1), ("counts", 0.5, 1.5), ("model error in motion", 2.4, 3.0),
    ("5 % outliers", 1.0, 1.2), ("10 % outliers", 1.05, 1.35), ("5 % outliers, model error in motion", 2.5, 3.4)])
def test_the_scale_of_residuals(kind, lowest, highest):
    """A share f of outliers moves the median to the quantile 0.5/(1 - f): by 7 % at 5 %, 14 % at 10 %.

    An error of 20 in a fifth of the samples is an rms of 9, of which 0.3 is 2.7.
    """
    assert lowest < scatter(*residuals(kind)) < highest


def test_what_stands_or_moves_for_a_few_values_only_does_not_count():
    white = np.random.default_rng(1).standard_normal(500)
    moves = np.zeros(500, np.bool_)
    moves[:5] = True
    assert scatter(np.where(moves, 100.0, white), moves) < 1.15
    assert moving(np.arange(5.0), np.zeros(5)).sum() == 0
    assert moving(np.zeros(1), np.ones(1)).tolist() == [False]
    ramp = np.array([0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0])
    assert moving(np.arange(7.0), ramp).tolist() == [False, False, True, True, True, False, False]


@pytest.mark.long
def test_a_fit_of_logs_with_outliers():
    """5 % of the samples are off by a radian: the noise is still the encoder's, and the intervals hold."""
    rng = np.random.default_rng(12)
    logs = []
    for log in some():
        angle = log.measured["output_angle"]
        off = np.where(rng.random(len(angle)) < 0.05, rng.choice([-1.0, 1.0], len(angle)), 0.0)
        logs.append(type(log)(name=log.name, time=log.time, command=log.command, command_kind=log.command_kind,
                              load=log.load, measured={"output_angle": angle + off}))
    fit = fitted(logs, free=FREE)
    assert fit.noise["output_angle"] == pytest.approx(1e-3, rel=0.25)
    assert fit.warnings == ()
    near(fit, widths=4.0)


def test_noise_of_times_counts_as_far_as_the_signal_moves_about_a_sample():
    """At 5 rad/s, 10 ms are 0.05 rad; 0.1 s after the shaft has come to rest, what came late counts no more."""
    time = np.arange(0.0, 1.0, 0.02)
    angle = np.clip(5.0 * (time - 0.3), 0.0, 1.0)
    log = st.Log(name="a", time=time, command=np.where(time < 0.3, 0.0, 1.0), command_kind="angle",
                 measured={"output_angle": angle})
    model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    case = make_case(log, model, Space(model, ["output_inertia"]), ("output_angle",))
    assert case.sigma("output_angle", {"output_angle": 0.02}) == 0.02
    sigma = case.sigma("output_angle", {"output_angle": 0.02, "time": 0.01})
    assert sigma[(time > 0.3) & (time < 0.6)] == pytest.approx(np.hypot(0.02, 0.05))
    assert sigma[(time < 0.15) | (time > 0.65)] == pytest.approx(0.02)


@pytest.mark.long
def test_a_fit_with_noise_of_times_is_that_of_its_residuals_in_rad():
    fit = fitted(some(), free=FREE, noise={"output_angle": 1e-3, "time": 1e-4})
    assert fit.noise == {"output_angle": 1e-3}
    assert np.std(np.concatenate([trace.residual for trace in fit.traces])) == pytest.approx(1e-3, rel=0.1)
    near(fit, widths=4.0)
    with pytest.raises(InputError, match="time"):
        fitted(some(), free=FREE, noise={"stamps": 1e-4})
