"""The command blocks of README and docs: each is marked, and runs as printed.

A comment before a block says how it is treated:

    <!-- run -->              here
    <!-- slow: 1000 = 4 -->   in the slow suite, with 4 in place of 1000
    <!-- shown: its reason --> nowhere, for the reason that is named

The blocks of a page are run from its top, by one shell, in a folder with the examples of the
project and, in the slow suite, with what a user would have made before.
"""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import clips
import numpy as np
import pytest
from markdown_it import MarkdownIt
from PIL import Image

from lime_keras.io import photo

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
LOGS = (DOCS / "results.md", DOCS / "lab")
"""Pages of what was measured: their commands took hours, on data that does not come along."""
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "lime_keras" / "pretrained" / "README.md",
    *(
        page
        for page in sorted(DOCS.rglob("*.md"))
        if "_build" not in page.parts and not any(page.is_relative_to(log) for log in LOGS)
    ),
]
MARK = re.compile(r"<!-- (run|slow|shown)(?:: (.+?))? -->\n?")


@dataclass
class Block:
    """A block of commands: its kind, what is said beside the kind, and its text."""

    kind: str | None
    said: str
    text: str

    @property
    def commands(self):
        """The text with what the mark puts in place of its words."""
        text = self.text
        for pair in filter(None, self.said.split("; ")):
            printed, _, tried = pair.partition(" = ")
            assert printed in text and tried, f"{pair!r} fits nothing in\n{text}"
            text = text.replace(printed, tried)
        return text


def blocks(page):
    """Yield the blocks of a page that are no listing in another language."""
    tokens = MarkdownIt().parse(page.read_text(encoding="utf-8"))
    for before, token in zip([None, *tokens], tokens, strict=False):
        if token.type == "code_block" or (token.type == "fence" and not token.info):
            mark = before and before.type == "html_block" and MARK.fullmatch(before.content)
            kind, said = mark.groups(default="") if mark else (None, "")
            yield Block(kind, said, token.content)


def script_of(page, kinds):
    """Return the commands of the blocks of these kinds."""
    return "\n".join(block.commands for block in blocks(page) if block.kind in kinds)


def pages(kind, kinds):
    """Return the pages with a block of a kind; of those with the same script, the first."""
    found = {}
    for page in PAGES:
        if any(block.kind == kind for block in blocks(page)):
            found.setdefault(script_of(page, kinds), page)
    return [pytest.param(page, id=page.relative_to(ROOT).as_posix()) for page in found.values()]


def run(page, kinds, folder):
    """Run the blocks of these kinds as one script, which ends at the first command that fails."""
    script = script_of(page, kinds)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script],
        cwd=folder,
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, f"{script}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_block_is_marked(page):
    for block in blocks(page):
        assert block.kind, f"say run, slow or shown before\n{block.text}"
        assert block.said or block.kind != "shown", f"say why it is only shown:\n{block.text}"


@pytest.fixture
def desk(tmp_path):
    """A folder with what comes with the project, and a video."""
    for name in ("examples", "benchmarks"):
        (tmp_path / name).symlink_to(ROOT / name)
    fox = photo.read_srgb(ROOT / "examples" / "photos" / "fox.png")
    levels = np.round(255 * fox).astype(np.uint8)
    clips.write(tmp_path / "turntable.mp4", np.stack([levels] * 3), codec="libx264")
    return tmp_path


@pytest.fixture
def stocked_desk(desk, tiny_model):
    """A desk with a user's meshes, maps, normals, corpus and runs, too."""
    # They bring Mitsuba and TensorFlow, which the fast tests need not wait for.
    import render_scenes
    import sphere_corpus

    made = desk / "made"
    made.mkdir()
    render_scenes.write_inputs(made)
    for kind, name in (("shapes", "meshes"), ("environments", "hdris")):
        for split, file in zip(("train", "test"), sorted((made / kind).iterdir()), strict=True):
            (desk / name / split).mkdir(parents=True)
            shutil.copyfile(file, desk / name / split / file.name)
    shutil.copyfile(made / "shapes" / "ball.ply", desk / "teapot.ply")
    Image.fromarray(hemisphere(256)).save(desk / "normals.png")
    sphere_corpus.write_split(desk / "corpus", "train", [range(64), range(64, 70)], size=32)
    sphere_corpus.write_split(desk / "corpus", "test", [range(64)], seed=1, size=32)
    (desk / "answers").mkdir()
    (desk / "answers" / "00000.json").write_text('{"exponent": 30}', encoding="utf-8")
    for name in ("mine", "before", "after"):
        shutil.copytree(tiny_model.parent, desk / "runs" / name)
    return desk


def hemisphere(size):
    """Return the normals of a ball as a picture of (n + 1) / 2, `(size, size, 3)` uint8."""
    down, across = 2 * (np.indices((size, size)) + 0.5) / size - 1
    towards = np.sqrt(np.clip(1 - across**2 - down**2, 0.01, 1))
    normals = np.stack([across, -down, towards], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.round(255 * (normals + 1) / 2).astype(np.uint8)


@pytest.mark.parametrize("page", pages("run", ("run",)))
def test_its_commands_run(page, desk):
    run(page, ("run",), desk)


@pytest.mark.slow
@pytest.mark.parametrize("page", pages("slow", ("run", "slow")))
def test_all_its_commands_run(page, stocked_desk):
    run(page, ("run", "slow"), stocked_desk)
