import pytest

import servotwin as st
from servotwin.bench import Bench, bench_servo, table_fits


@pytest.fixture(scope="session")
def table():
    return st.load_dataset("urrea-kern-table-2").columns


@pytest.fixture(scope="session")
def fits(table):
    return table_fits(table)


@pytest.fixture(params=["BoundedServo", "AveragedServo", "PulseServo"], scope="session")
def bench(request, servo):
    return Bench(getattr(st, request.param)(bench_servo(servo)))


@pytest.fixture(scope="session")
def rows(bench, table):
    return bench.measure(table["V_i_V"])
