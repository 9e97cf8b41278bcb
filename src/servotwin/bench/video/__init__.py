"""The angle of a horn out of a phone's clip: a printed mark, the clip that shows it, and the log that comes of both."""

from servotwin.bench.video.film_log import write_film_log
from servotwin.bench.video.filmed import Filmed, read_clip
from servotwin.bench.video.marker import DICTIONARY, mark_bytes

__all__ = ["DICTIONARY", "Filmed", "mark_bytes", "read_clip", "write_film_log"]
