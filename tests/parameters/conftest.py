"""Random servos, every one that the groups accept; and what stands beside a field that is refused alone."""

import dataclasses

from hypothesis import strategies as st

from servotwin.errors import HIDDEN
from servotwin.parameters import GROUPS, ORIGINS, Quantity, Servo, unit_of

_NUMBERS = {
    "a positive number": st.floats(1e-12, 1e12), "a number of at least 0": st.floats(0.0, 1e12),
    "a finite number": st.floats(allow_nan=False, allow_infinity=False),
    "a number of at least 1": st.floats(1.0, 1e12), "a number from 0 to 1": st.floats(0.0, 1.0),
}
# What must not be together, or must be in order, is made so afterwards
_OTHER_LAW = ("load_friction", "load_friction_stribeck")

MASSES = {"winding_capacity": 2.0, "housing_capacity": 30.0, "winding_to_housing": 8.0, "housing_to_ambient": 16.0}
FIRMWARE_ALONE = ("compute_delay", "bus_latency", "derivative_ticks", "whole_counts", "integral_at_rest", "signal_loss")
COMPANIONS = {"friction.stribeck_exponent": {"stribeck_speed": 10.0}, "gear.damping": {"stiffness": 50.0},
              "thermal.magnet_coefficient": MASSES,
              **{f"thermal.{name}": {key: MASSES[key] for key in MASSES if key != name} for name in MASSES}}


@st.composite
def group_values(draw, kind):
    values = {}
    for f in dataclasses.fields(kind):
        rule = f.metadata["rule"]
        if rule == "table" or not draw(st.booleans()):
            continue
        values[f.name] = draw(st.sampled_from(rule)) if isinstance(rule, tuple) else draw(_NUMBERS[rule])
    for low, high in (("lower_angle", "upper_angle"), ("pulse_width_min", "pulse_width_max"),
                      ("bridge_drop_voltage", "open_circuit_voltage"), ("lower_goal", "upper_goal")):
        if low in values and high in values:
            values[low], values[high] = sorted((values[low], values[high]))
            if values[low] == values[high]:
                del values[low]
    if "stribeck_speed" not in values:
        values.pop("stribeck_exponent", None)
    if kind is GROUPS["gear"] and "stiffness" not in values:
        values.pop("damping", None)
    if any(name in values for name in _OTHER_LAW):
        values = {k: v for k, v in values.items() if not k.startswith("load_friction") or k in _OTHER_LAW}
    if kind is GROUPS["thermal"]:
        heat = draw(st.booleans())
        values |= {name: draw(_NUMBERS["a positive number"]) for name in MASSES if heat and name not in values}
        values = {k: v for k, v in values.items() if heat or k == "ambient"}
    if kind is GROUPS["firmware"]:
        values = {name: values[name] for name in values if name not in FIRMWARE_ALONE}
    if kind is GROUPS["potentiometer"] and draw(st.booleans()):
        angles = sorted(draw(st.sets(st.floats(-4.0, 4.0), min_size=1, max_size=6)))
        values["linearity_angle"] = tuple(angles)
        values["linearity_error"] = tuple(draw(st.floats(-1.0, 1.0)) for _ in angles)
    return values


def without_stops_if_endless(groups):
    """Take the stops away from a servo that turns without end."""
    return {k: v for k, v in groups.items() if k != "stops" or "fixed_angle" not in groups.get("potentiometer", {})}


plain_values = st.fixed_dictionaries(
    {}, optional={name: group_values(kind) for name, kind in GROUPS.items()}).map(without_stops_if_endless)
texts = st.text(st.characters(codec="utf-8"), max_size=40)
names = texts.map(lambda text: HIDDEN.sub("", text))  # others are refused
toml_values = st.recursive(
    st.booleans() | st.integers(-2**60, 2**60) | st.floats(allow_nan=False, allow_infinity=False) | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3), max_leaves=6)
tables = st.dictionaries(texts, toml_values, max_size=4)


@st.composite
def servos(draw):
    groups = {name: GROUPS[name](**values) for name, values in draw(plain_values).items()}
    quantities = {}
    for name, group in groups.items():
        for f in dataclasses.fields(group):
            value = getattr(group, f.name)
            if value is None:
                continue
            origin = draw(st.sampled_from(ORIGINS))
            spread = {}
            if isinstance(value, float):
                spread = draw(st.sampled_from([
                    {}, {"std": abs(value) / 7}, {"lower": value - abs(value) / 3}, {"upper": value + abs(value) / 3},
                    {"lower": value, "upper": value}]))
                spread = {k: v for k, v in spread.items() if abs(v) < 1e308}
            source = draw(texts.filter(bool)) if origin != "assumed" else draw(st.none() | texts)
            quantities[f"{name}.{f.name}"] = Quantity(
                value=value, unit=unit_of(f"{name}.{f.name}"), origin=origin, source=source, **spread)
    return Servo(name=draw(names.filter(bool)), title=draw(names), notes=draw(texts), quantities=quantities,
                 sheet=draw(tables), fit=draw(tables), **groups)
