"""The site of the documentation: it is built, and the demo in it works."""

import re
import subprocess
import sys
from pathlib import Path

import chromium
import pytest
import script_files
import static_page

from lime_keras.live import static

DOCS = Path(__file__).parent.parent / "docs"


@pytest.fixture(scope="module")
def demo():
    """The script that writes the demo."""
    return script_files.load(DOCS / "demo.py")


@pytest.fixture
def no_registry(monkeypatch):
    """Let the runtime not be fetched."""

    def unreachable():
        raise OSError("the registry cannot be reached")

    monkeypatch.setattr(static, "fetched_runtime", unreachable)


@pytest.fixture
def a_runtime(monkeypatch):
    """Let nothing be fetched as the runtime."""
    monkeypatch.setattr(static, "fetched_runtime", static_page.runtime)


def test_without_the_registry_the_site_says_what_is_missing(demo, no_registry, tmp_path, capsys):
    demo.main(tmp_path / "live")
    assert "cannot be reached" in capsys.readouterr().err
    page = (tmp_path / "live" / "index.html").read_text(encoding="utf-8")
    assert "The demo is missing" in page and "make docs" in page


def test_the_demo_takes_the_place_of_the_page_that_misses_it(
    demo, a_runtime, tmp_path, monkeypatch
):
    (tmp_path / "live").mkdir()
    (tmp_path / "live" / "index.html").touch()
    demo.main(tmp_path / "live")
    assert (tmp_path / "live" / "engine.json").is_file()


def test_without_the_registry_a_demo_that_is_there_stays(demo, a_runtime, tmp_path, request):
    demo.main(tmp_path / "live")
    before = (tmp_path / "live" / "index.html").read_bytes()
    request.getfixturevalue("no_registry")
    demo.main(tmp_path / "live")
    assert (tmp_path / "live" / "index.html").read_bytes() == before


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site, without the demo."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "--builder", "html", "--fail-on-warning"]
    places = ["--doctree-dir", folder / "trees", DOCS, folder / "site"]
    done = subprocess.run([*command, "--keep-going", *places], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "site"


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(site):
    assert "usage: lime-estimate" in (site / "reference" / "commands.html").read_text("utf-8")
    assert "<math" in (site / "explanation" / "scene-model.html").read_text("utf-8")
    # The marks of command blocks are for the tests alone.
    for page in site.rglob("*.html"):
        assert not re.search(r"&lt;!-- (run|slow|shown)", page.read_text("utf-8")), page


@pytest.mark.slow
def test_the_demo_of_the_site_gets_a_material(demo, site, tmp_path_factory, monkeypatch):
    """From the landing page on, in Chromium."""
    if not static_page.RUNTIME.is_dir():
        pytest.skip(f"there is no onnxruntime-web: npm ci --prefix {static_page.EXAMPLES}")
    monkeypatch.setattr(static, "fetched_runtime", static_page.runtime)
    demo.main(site / "live")
    with (
        chromium.browser(tmp_path_factory.mktemp("chromium")) as browser,
        chromium.tab(browser) as page,
        chromium.serving(site) as port,
    ):
        page.goto(f"http://127.0.0.1:{port}/index.html")
        page.click("a[href='live/index.html']")
        page.click("#sample")
        page.wait_for_function("document.getElementById('exponent').textContent.match(/[0-9]/)")


@pytest.mark.slow
@pytest.mark.parametrize("page", ["index", "results", "reference/commands", "start/photo"])
def test_a_page_of_the_site_fits_a_phone(page, site, tmp_path_factory):
    """Its tables and code scroll inside themselves; the page does not."""
    with (
        chromium.browser(tmp_path_factory.mktemp("chromium")) as browser,
        chromium.tab(browser) as tab,
        chromium.serving(site) as port,
    ):
        tab.set_viewport_size({"width": 360, "height": 800})
        tab.goto(f"http://127.0.0.1:{port}/{page}.html")
        assert tab.evaluate("document.documentElement.scrollWidth") <= 360
