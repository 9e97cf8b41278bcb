"""Write the C header of the protocol: `header.py protocol.toml > protocol.h`. Needs nothing but Python 3.11."""

import sys
import tomllib
from pathlib import Path

TYPES = {"u8": ("uint8_t", "", 1), "u16": ("uint16_t", "", 2), "u32": ("uint32_t", "", 4), "text8": ("char", "[8]", 8)}
TABLES = ("channels", "reference", "rate", "mode", "result", "event")
HEAD = """// Made by header.py of protocol.toml, which says what all of this means. Do not edit.
#pragma once
#include <stdint.h>"""


def constants(protocol: dict) -> list[str]:
    """Numbers that stand alone, and tables of names."""
    lines = []
    for name, value in protocol.items():
        if isinstance(value, float):
            lines.append(f"#define {name.upper()}_MS {round(1000 * value)}u")
        elif isinstance(value, int):
            lines.append(f"#define {name.upper()} {value}{'ul' if value > 65535 else 'u'}")
    for table in TABLES:
        prefix = table.removesuffix("s").upper()
        names = protocol[table]
        lines += ["", *(f"#define {prefix}_{name.upper()} {value}u" for name, value in names.items())]
        lines.append(f"#define {prefix}_COUNT {len(names)}u")
    return lines


def message(entry: dict) -> list[str]:
    """Kind of a message, the part of its payload that always has the same length, and that length."""
    name, size, fields = entry["name"], 0, []
    for field in entry["fields"]:
        if field["type"] not in TYPES:
            break  # what varies in length is the last field
        kind, dimension, length = TYPES[field["type"]]
        fields.append(f"  {kind} {field['name']}{dimension};")
        size += length
    lines = ["", f"#define KIND_{name.upper()} 0x{entry['kind']:02x}u", f"#define LENGTH_{name.upper()} {size}u"]
    return [*lines, f"struct __attribute__((packed)) message_{name} {{", *fields, "};"] if fields else lines


def main() -> None:
    """Print the header."""
    protocol = tomllib.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    lines = [HEAD, "", *constants(protocol)]
    for entry in protocol["message"]:
        lines += message(entry)
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
