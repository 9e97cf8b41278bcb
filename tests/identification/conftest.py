"""The logs and the fit that several files ask about."""

import pytest

from identification.fits import fitted, some


@pytest.fixture(scope="session")
def logs():
    return some()


@pytest.fixture(scope="session")
def fit(logs):
    return fitted(logs)
