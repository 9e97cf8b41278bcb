"""What all tests share: a servo, a model of every class, and a folder of measured data where there is one."""

from pathlib import Path

import pytest

import servotwin as st
from servotwin.models import MODELS


@pytest.fixture(scope="session")
def servo():
    return st.load_servo("hitec-hs-755hb")


@pytest.fixture(scope="session")
def data_folder():
    folder = Path(__file__).resolve().parents[1].parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"measured data not found beside the repository ({folder})")
    return folder


@pytest.fixture(params=list(MODELS), scope="session")
def model(request, servo):
    return MODELS[request.param](servo)
