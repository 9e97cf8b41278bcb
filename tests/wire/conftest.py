"""Arms that are served, as people start them."""

import pytest

from wire_served import served


@pytest.fixture(scope="module")
def so101(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wire")
    with served("so101", "--no-body", "--link", folder / "so101", "--keep", folder / "kept.json") as facts:
        yield {**facts, "folder": folder}


@pytest.fixture(scope="module")
def koch():
    with served("koch") as facts:
        yield facts
