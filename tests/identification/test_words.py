"""What logs cannot say, in words: products that stay the same along directions that no log sees."""

import math

import numpy as np
import pytest

from servotwin.identification.fitting.uncertainty import Unidentifiable, explain, vague_directions

KM, N, J, F, R = ("motor.torque_constant", "gear.gear_reduction", "motor.rotor_inertia",
                  "friction.coulomb_torque_forward", "motor.armature_resistance")
PRODUCT = "·"


def seen(*products, strength=1e4):
    """Return the information of logs that see these combinations of logarithms only."""
    rows = np.array(products, float)
    return strength * rows.T @ rows


def words(names, information, shares=None):
    flags, directions = vague_directions(information)
    return flags, explain(names, shares or [1.0] * len(names), flags, directions)


def test_a_pair_of_which_only_the_product_is_seen():
    flags, (item,) = words([KM, N, R], seen([1, 1, 0], [0, 0, 1]))
    assert flags.tolist() == [True, True, False]
    assert set(item.parameters) == {KM, N}
    assert set(item.combinations) <= {f"{KM} {PRODUCT} {N}", f"{N} {PRODUCT} {KM}"}
    assert len(item.combinations) == 1
    assert item.direction[0] == pytest.approx(-item.direction[1])
    assert "is determined, not" in str(item)


def test_a_pair_of_which_only_the_ratio_is_seen():
    _, (item,) = words([KM, R], seen([1, -1]))
    assert item.combinations in ((f"{KM} / {R}",), (f"{R} / {KM}",))


def test_a_gear_hides_its_reduction_in_every_product():
    """N k_t, N² J and N F are seen: three products of four numbers, one direction."""
    flags, (item,) = words([N, KM, J, F], seen([1, 1, 0, 0], [2, 0, 1, 0], [1, 0, 0, 1]))
    assert flags.all()
    assert set(item.parameters) == {N, KM, J, F}
    logs = {N: 1.0, KM: -1.0, J: -2.0, F: -1.0}
    step = dict(zip(item.parameters, item.direction, strict=True))
    for name in logs:
        assert step[name] / step[N] == pytest.approx(logs[name], rel=1e-6)
    assert len(item.combinations) == 3
    for text in item.combinations:  # each is a product that does not change along the direction
        assert _change(text, logs) == pytest.approx(0.0)
    assert f"{J} {PRODUCT} {N}²" in item.combinations or any("²" in text for text in item.combinations)


def _change(text, logs):
    """Return how far the logarithm of a product goes."""
    sign = -1.0 if " / " in text else 1.0
    first, second = text.split(" / " if " / " in text else f" {PRODUCT} ")
    power = 1.0
    if second.endswith("²"):
        second, power = second[:-1], 2.0
    elif "^(" in second:
        second, fraction = second[:-1].split("^(")
        a, _, b = fraction.partition("/")
        power = float(a) / float(b or 1)
    return logs[first] + sign * power * logs[second]


def test_two_separate_pairs_are_two_lines():
    names = [KM, N, R, J]
    flags, items = words(names, seen([1, 1, 0, 0], [0, 0, 1, -1]))
    assert flags.all()
    assert [set(item.parameters) for item in items] in ([{KM, N}, {R, J}], [{R, J}, {KM, N}])


def test_a_number_without_any_effect_stands_alone():
    flags, items = words([KM, N], seen([0, 1]))
    assert flags.tolist() == [True, False]
    assert [item.parameters for item in items] == [(KM,)]
    assert str(items[0]) == f"{KM} is not determined by these logs"


def test_everything_determined_needs_no_words():
    flags, items = words([KM, N], np.diag([1e4, 1e4]))
    assert not flags.any()
    assert items == ()


def test_where_a_number_may_be_zero_there_is_no_product():
    _, (item,) = words(["friction.load_friction", F], seen([1, 1]), shares=[math.nan, 1.0])
    assert item.combinations == ()
    assert "a change of one is made up for by the others" in str(item)


def test_shares_make_products_of_numbers_that_are_searched_plainly():
    """A direction (2, -1) of numbers of which the first changes by half as much of its value: their product stays."""
    _, (item,) = words([F, N], seen([0.5, 1.0]), shares=[0.5, 1.0])
    assert item.combinations in ((f"{F} {PRODUCT} {N}",), (f"{N} {PRODUCT} {F}",))


@pytest.mark.parametrize(("strength", "vague"), [(0.0, True), (1e-3, True), (0.5, True), (100.0, False), (1e9, False)])
def test_what_is_flagged_depends_on_what_the_logs_say(strength, vague):
    """A standard error of a factor e or more is no knowledge; one of a few per cent is."""
    flags, directions = vague_directions(np.diag([strength, 1e9]))
    assert flags.tolist() == [vague, False]
    assert directions.shape == (2, int(vague))


def test_correlated_residuals_make_vague_what_was_not():
    information = np.diag([9.0, 1e6])
    assert not vague_directions(information)[0].any()
    assert vague_directions(information, inflation=5.0)[0].tolist() == [True, False]


def test_two_numbers_that_are_hard_to_tell_apart_are_still_two_numbers():
    """Correlation of 0.999, but enough data: both have standard errors of some per cent, so both count."""
    C = np.array([[1.0, 0.999], [0.999, 1.0]]) * 0.05**2
    flags, directions = vague_directions(np.linalg.inv(C))
    assert not flags.any()
    assert directions.shape[1] == 0


@pytest.mark.parametrize(("item", "text"), [
    (Unidentifiable((KM, N), (1.0, -1.0), (f"{KM} · {N}",), ("a motor current measurement",)),
     f"only {KM} · {N} is determined, not {KM} and {N} each; a motor current measurement would separate them"),
    (Unidentifiable((KM,), (1.0,), (), ("a potentiometer tap", "a known weight on an arm")),
     f"{KM} is not determined by these logs; a potentiometer tap or a known weight on an arm would tell"),
    (Unidentifiable((KM, N, J), (1.0, -1.0, 1.0), (f"{KM} · {N}", f"{J} · {N}")),
     f"only {KM} · {N} and {J} · {N} are determined, not {KM}, {N} and {J} each"),
], ids=["pair", "alone", "three"])
def test_lines(item, text):
    assert str(item) == text
