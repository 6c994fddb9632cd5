"""Markdown that is a table to a parser and to the eye."""

from markdown_it import MarkdownIt

from lime_keras.eval.markdown_table import aligned

LINES = [("Run", "ms", "note"), ("a", "1.50", "x|y"), ("  longer", "12.25", "")]


def test_a_parser_finds_every_cell_and_its_side():
    html = MarkdownIt("commonmark").enable("table").render(aligned(LINES, texts=(0, 2)))
    assert html.count("<tr>") == 3 and html.count("<td") == 6
    assert html.count('style="text-align:right"') == 3
    assert "<td>x|y</td>" in html and '<td style="text-align:right">12.25</td>' in html


def test_the_eye_finds_columns():
    assert aligned(LINES, texts=(0, 2)).splitlines() == [
        "| Run      |    ms | note |",
        "|----------|------:|------|",
        "| a        |  1.50 | x\\|y |",
        "|   longer | 12.25 |      |",
    ]
    assert aligned(LINES).splitlines()[1] == "|----------|------:|-----:|"
