"""The page as one file, unpacked for node."""

import shutil

import pytest

from bench_made import unpacked
from servotwin.web.alone import page


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Return a folder with the modules and the kernel of the page."""
    if shutil.which("node") is None:
        pytest.skip("no node")
    try:
        return unpacked(tmp_path_factory.mktemp("page"))
    except page.NoCompilerError as error:
        pytest.skip(str(error))
