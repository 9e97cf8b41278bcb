"""The one reader and writer of tables: CSV as this package writes it, and in all dialects of other people's tools."""

from servotwin.tables.columns import csv_text, read_columns
from servotwin.tables.reading import SEPARATORS, TextTable, read_table, said_lines

__all__ = ["SEPARATORS", "TextTable", "csv_text", "read_columns", "read_table", "said_lines"]
