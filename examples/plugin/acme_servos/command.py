"""`servotwin counts`: how many counts of a sensor a servo's travel has."""

import math
from typing import Annotated

import typer

import servotwin as st


def counts(servo: Annotated[str, typer.Argument(help="Catalog id, or path of a servo file.")],
           bits: Annotated[int, typer.Option(help="Of the sensor, over a whole turn.")] = 12) -> None:
    """Count what a sensor sees of a servo's travel."""
    stops = st.load_servo(servo).stops
    typer.echo(f"{(stops.upper_angle - stops.lower_angle) / (2.0 * math.pi) * 2**bits:.0f} counts")
