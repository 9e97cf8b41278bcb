"""Tables as other people's tools write them: one reader of CSV in all its dialects."""

from servotwin.tables.dialect import SEPARATORS
from servotwin.tables.reading import TextTable, read_table

__all__ = ["SEPARATORS", "TextTable", "read_table"]
