"""Sections of Markdown, and the page that holds them."""

import base64
import io

import numpy as np
import pytest
from matplotlib import image as png_reader

from lime_keras.eval.report import figures, page

_TABLE = "## Title\n\n| a | b |\n|---|--:|\n| <script>x</script> | 1 |\n"


def test_a_measured_section_holds_its_table_figure_and_command():
    matrix = figures.confusions({"one": np.eye(8, dtype=int)})
    picture = (matrix, "a matrix", "look & see")
    html = page.measured("A & B", _TABLE, [picture], command="lime-eval 'a b'")
    assert "<h1>A &amp; B</h1>" in html and "lime-eval &#39;a b&#39;" in html
    assert "<table>" in html and "<h2>Title</h2>" in html
    assert "<script>" not in html and "&lt;script&gt;" in html
    assert html.count("data:image/png;base64,") == 1 and "look &amp; see" in html


def test_the_page_has_its_sections_in_order_and_stands_alone():
    html = page.whole([("first", "First", "<p>one</p>"), ("second", "Second & last", "<p>two</p>")])
    assert html.index('href="#first"') < html.index('href="#second"') < html.index("<p>one</p>")
    assert html.index("<p>one</p>") < html.index("<p>two</p>")
    assert "Second &amp; last" in html
    assert "http://" not in html and "https://" not in html and "src=" not in html


def test_images_become_pngs_in_the_page():
    picture = np.linspace(0, 1, 4 * 5 * 3).reshape(4, 5, 3)
    html = page.measured("A", "", [(picture, "", "")], command="")
    data = base64.b64decode(html.partition("base64,")[2].partition('"')[0])
    back = png_reader.imread(io.BytesIO(data), format="png")[..., :3]
    assert back == pytest.approx(picture, abs=1 / 255)
