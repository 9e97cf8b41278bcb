"""The tables of a kitchen: the same for a seed, as long as they have to be, and near what they were made of."""

import math

import pytest

from reference import kitchen_tables


@pytest.mark.parametrize("kind", kitchen_tables.KINDS)
def test_tables_are_those_of_their_seed(kind):
    one, again, other = (kitchen_tables.table(kind, seed) for seed in (1, 1, 2))
    assert one == again
    assert one.text != other.text
    header, *rows = one.text.splitlines()
    assert len(rows) >= 5
    assert all(row.count(",") == header.count(",") for row in rows)


def test_the_laws_of_lifting_end_at_the_stall_torque():
    for seed in range(20):
        servo = kitchen_tables.table("speed", seed).servo
        assert math.isclose(servo.current(servo.stall_torque), (servo.V - servo.V_d) / servo.R, rel_tol=1e-12)
        assert abs(servo.speed(servo.stall_torque)) < 1e-12 * servo.speed(0.0) + 1e-12
        assert abs(servo.speed(0.0, servo.starts_at)) < 1e-12
