"""What is shipped is what the sources give, and it fits."""

from pathlib import Path

FLASH_BAR = 16 * 1024  # bytes


def flash_bytes(path: Path) -> int:
    """Count the data bytes of an Intel hex file, and check its sums."""
    total = 0
    for line in path.read_text().split():
        record = bytes.fromhex(line.removeprefix(":"))
        assert sum(record) % 256 == 0
        total += record[0] if record[3] == 0 else 0
    return total


def test_the_shipped_firmware_is_what_the_sources_give(make, shipped):
    built, said = make()
    assert built.read_bytes() == shipped.read_bytes()
    assert f"flash {flash_bytes(shipped)} of" in said


def test_the_firmware_fits(shipped):
    assert 1000 < flash_bytes(shipped) <= FLASH_BAR
