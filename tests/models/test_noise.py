"""The counting noise: a Gaussian, the same everywhere, without a trace of seed and frame."""

import numpy as np
import pytest
from scipy import stats

from servotwin.models.state.noise import gaussian, scrambled


@pytest.fixture(scope="module")
def draws():
    return np.array([[gaussian(seed, frame) for frame in range(300)] for seed in range(-50, 50)])


def test_mean_variance_and_distribution(draws):
    n = draws.size
    assert abs(draws.mean()) < 4.0 / np.sqrt(n)
    assert abs(draws.var() - 1.0) < 4.0 * np.sqrt(2.0 / n)
    assert stats.kstest(draws.ravel(), "norm").pvalue > 1e-3


@pytest.mark.parametrize("lag", [1, 2, 7])
def test_neighbours_are_independent(draws, lag):
    limit = 4.0 / np.sqrt(draws.size)
    assert abs(np.mean(draws[:, lag:] * draws[:, :-lag])) < limit  # frames
    assert abs(np.mean(draws[lag:] * draws[:-lag])) < limit  # seeds


def test_seeds_of_64_bits_differ():
    seeds = [0, 1, -1, 2**32, 2**62, -2**63, 2**63 - 1]
    assert len({gaussian(seed, 3) for seed in seeds}) == len(seeds)


def test_the_hash_is_one_to_one_on_a_sample():
    assert len({scrambled(n) for n in range(20000)}) == 20000
