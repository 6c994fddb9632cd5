"""The folder of the page without Python, and where its runtime comes from."""

import base64
import hashlib
import io
import json
import shutil
import tarfile
import urllib.request
from pathlib import Path

import pytest
import static_page
from static_page import HEADERS

from lime_keras.live import static
from lime_keras.model import folder as model_folder
from lime_keras.version import __version__


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return static_page.write(tmp_path_factory.mktemp("static"))


def test_what_the_description_names_is_there(written):
    held = json.loads((written / "engine.json").read_text(encoding="utf-8"))
    assert (held["engine"], held["version"], held["size"]) == ("browser", __version__, 128)
    placed = [*held["runtime"].values()]
    placed += held["graphs"].values()
    for file in placed:
        path = written / (file["wasm"] if "wasm" in file else file["path"])
        assert path.stat().st_size == file["bytes"]
        assert all((written / file[role]).is_file() for role in {"script", "module"} & set(file))
    # The largest file that Cloudflare Pages takes.
    assert max(path.stat().st_size for path in written.rglob("*")) < 25 * 2**20
    for name in ("index.html", "main.js", "service_worker.js", "runtime/LICENSE", ".nojekyll"):
        assert (written / name).is_file()


def test_hosts_send_the_headers(written):
    """In the words of Netlify and Cloudflare Pages, of Vercel, and of the service worker."""
    lines = (written / "_headers").read_text(encoding="utf-8").splitlines()
    assert lines == ["/*", *(f"  {name}: {value}" for name, value in HEADERS)]
    (rule,) = json.loads((written / "vercel.json").read_text(encoding="utf-8"))["headers"]
    assert [(row["key"], row["value"]) for row in rule["headers"]] == list(HEADERS)
    worker = (written / "service_worker.js").read_text(encoding="utf-8")
    assert all(f'"{name}", "{value}"' in worker for name, value in HEADERS)


def test_the_page_first_tells_what_is_missing(written):
    page = (written / "index.html").read_text(encoding="utf-8")
    assert page.count("browser/preflight.js") == 1
    assert "preflight" not in (static.PAGE / "index.html").read_text(encoding="utf-8")


def test_a_page_replaces_a_page_and_nothing_else(written, tmp_path):
    static.check(written)
    static.check(tmp_path / "new")
    (tmp_path / "empty").mkdir()
    static.check(tmp_path / "empty")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    for content in (None, "{}", "[]", "broken", '{"engine": "server"}'):
        if content is not None:
            (tmp_path / "mine" / "engine.json").write_text(content)
        with pytest.raises(ValueError, match="would be lost"):
            static.write(tmp_path / "mine", model_folder.DEFAULT, {})
    assert (tmp_path / "mine" / "thesis.tex").is_file()
    with pytest.raises(ValueError, match="is a file"):
        static.check(tmp_path / "mine" / "thesis.tex")
    with pytest.raises(ValueError, match="cannot be replaced: name a folder in it"):
        static.check(Path("."))


def test_what_lies_beside_a_page_is_not_lost(written, tmp_path):
    shutil.copytree(written, tmp_path / "site")
    (tmp_path / "site" / ".DS_Store").touch()
    static.check(tmp_path / "site")
    (tmp_path / "site" / "CNAME").touch()
    with pytest.raises(ValueError, match="site holds CNAME, which is no part of a page and would"):
        static.check(tmp_path / "site")


def test_a_folder_without_a_model_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="holds no trained model"):
        static.write(tmp_path / "site", tmp_path, {})
    assert not (tmp_path / "site").exists()


# The runtime from the registry.


def archive():
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w:gz") as packed:
        for row in static._RUNTIME.values():
            for name in row.values():
                member = tarfile.TarInfo(f"package/dist/{name}")
                member.size = len(name)
                packed.addfile(member, io.BytesIO(name.encode()))
    return content.getvalue()


@pytest.fixture
def expected_archive(monkeypatch):
    content = archive()
    digest = base64.b64encode(hashlib.sha512(content).digest()).decode()
    monkeypatch.setattr(static, "_SHA512", digest)
    return content


def test_the_runtime_comes_from_the_registry(expected_archive, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = []

    def urlopen(address, timeout):
        asked.append(address)
        return io.BytesIO(expected_archive)

    monkeypatch.setattr(urllib.request, "urlopen", urlopen)
    names = {name for row in static._RUNTIME.values() for name in row.values()}
    assert static.fetched_runtime() == {name: name.encode() for name in names}
    assert asked == [static._ADDRESS] and static.RUNTIME_VERSION in static._ADDRESS


def test_without_a_network_what_npm_packed_is_taken(expected_archive, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def urlopen(*_, **__):
        raise OSError("no network")

    monkeypatch.setattr(urllib.request, "urlopen", urlopen)
    with pytest.raises(OSError, match="npm pack onnxruntime-web"):
        static.fetched_runtime()
    Path(static._ARCHIVE).write_bytes(expected_archive)
    assert static.fetched_runtime()
    Path(static._ARCHIVE).write_bytes(expected_archive[:-9])
    with pytest.raises(ValueError, match="damaged"):
        static.fetched_runtime()


def test_the_example_has_the_release_of_the_page():
    package = json.loads((static_page.EXAMPLES / "package.json").read_text(encoding="utf-8"))
    assert package["dependencies"]["onnxruntime-web"] == static.RUNTIME_VERSION
    lock = json.loads((static_page.EXAMPLES / "package-lock.json").read_text(encoding="utf-8"))
    locked = lock["packages"]["node_modules/onnxruntime-web"]
    assert locked["version"] == static.RUNTIME_VERSION
    assert locked["integrity"] == f"sha512-{static._SHA512}"
