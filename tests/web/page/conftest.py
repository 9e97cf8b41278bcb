"""A browser that a module shares, a page that says what went wrong, and the tools from npm."""

import json
import os
import shutil
import subprocess
import urllib.parse
from pathlib import Path

import pytest

from servotwin.web.alone.page import NoCompilerError
from servotwin.web.alone.page import page as one_file
from servotwin.web.server.serve import first_scene

HERE = Path(__file__).parent
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
             "--disable-component-update", "--disable-sync"]
DESKTOP = {"width": 1280, "height": 900}


@pytest.fixture(scope="module")
def browser():
    """Chromium, without a window."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("no Chromium on this computer")
    with playwright.sync_playwright() as play:
        found = play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield found
        found.close()


@pytest.fixture
def opened(browser):
    """Open pages; at the end none may have had an error, or have asked another computer for anything."""
    wrong, contexts = [], []

    def watch(page, own):
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
        page.on("request", lambda request: None if _inside(request.url, own) else wrong.append(request.url))
        page.on("websocket", lambda line: None if _inside(line.url, own) else wrong.append(line.url))

    def open_page(address, *, ready="body.ready", viewport=DESKTOP, **options):
        own = urllib.parse.urlsplit(address).netloc
        context = browser.new_context(viewport=viewport, bypass_csp=True, **options)  # to wait for conditions
        contexts.append(context)
        context.set_default_timeout(15000)
        page = context.new_page()
        watch(page, own)
        page.goto(address)
        page.wait_for_selector(ready)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert wrong == []


@pytest.fixture(scope="session")
def bench_file(tmp_path_factory):
    """The page as one file, as its address on this disk."""
    try:
        text = one_file(first_scene())
    except NoCompilerError as error:
        pytest.skip(str(error))
    path = tmp_path_factory.mktemp("page") / "bench.html"
    path.write_text(text, encoding="utf-8")
    return path.as_uri()


@pytest.fixture(params=["server", "file"])
def home(request):
    """The address of a page: a server's, and that of the page as one file, which has to do the same."""
    return request.getfixturevalue("server" if request.param == "server" else "bench_file")


@pytest.fixture
def page(opened, home):
    """The page, with time going on."""
    made = opened(home)
    made.wait_for_function("bench.time > 0.3")
    return made


def _inside(url, own):
    parts = urllib.parse.urlsplit(url)
    return parts.scheme in ("data", "blob") or parts.netloc == own


@pytest.fixture(scope="session")
def tools():
    """Folder with the tools from npm, each of one version, kept in the user's cache."""
    if not (shutil.which("node") and shutil.which("npm")):
        pytest.skip("no node or npm (Debian: nodejs, npm)")
    wanted = (HERE / "package.json").read_text()
    versions = json.loads(wanted)["dependencies"]
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "servotwin-tests" / "-".join(f"{name}-{version}" for name, version in sorted(versions.items()))
    if not all((folder / "node_modules" / name / "package.json").exists() for name in versions):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "package.json").write_text(wanted)
        try:
            done = subprocess.run(["npm", "install", "--no-audit", "--no-fund", "--no-package-lock"], cwd=folder,
                                  capture_output=True, text=True, check=False, timeout=120)
        except subprocess.TimeoutExpired:
            pytest.skip("npm did not answer within two minutes")
        if done.returncode:
            pytest.skip(f"npm could not install {wanted}: {done.stderr.strip().splitlines()[-1:]}")
    return folder / "node_modules"
