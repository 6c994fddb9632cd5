"""The report as one self-contained HTML page: sections of numbers, figures and examples."""

import base64
from collections.abc import Iterable, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import jinja2
from markdown_it import MarkdownIt
from markupsafe import Markup

from lime_keras.version import __version__, installed

_TEMPLATES = Path(__file__).parent / "templates"
_VERSIONS = {"tensorflow": "TensorFlow", "keras": "Keras", "onnxruntime": "ONNX Runtime"}
"""Packages whose versions a section names, with their names in words."""


Picture = tuple[bytes, str, str]
"""A figure as PNG, its description for readers who cannot see it, and the text below it."""


def measured(title: str, text: str, pictures: Iterable[Picture], *, command: str) -> str:
    """Return a section of figures and Markdown as HTML.

    Args:
        title: heading of the section.
        text: Markdown below the figures; its tables become sortable.
        pictures: figures of the section.
        command: command that made the section, as typed.
    """
    html = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    html = html.replace("<table>", '<div class="wide"><table>')
    return rendered(
        "measured.html",
        title=title,
        command=command,
        figures=[(data_uri(png), *words) for png, *words in pictures],
        text=Markup(html.replace("</table>", "</table></div>")),
    )


def whole(sections: Sequence[tuple[str, str, str]]) -> str:
    """Return the report as HTML that needs no other file and no network.

    Args:
        sections: name, title and HTML of each section, in order.
    """
    shown = [{"name": name, "title": title, "html": Markup(html)} for name, title, html in sections]
    return rendered("report.html", sections=shown)


def rendered(template: str, **values: Any) -> str:
    """Return a file of `templates/`, filled with values by name, as HTML."""
    known = installed(_VERSIONS)
    versions = [f"{name} {known[package]}" for package, name in _VERSIONS.items() if known[package]]
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(
        made=date.today().isoformat(),
        versions=", ".join([f"lime_keras {__version__}", *versions]),
        **values,
    )


def data_uri(data: bytes) -> str:
    """Return a PNG as a data URI."""
    return f"data:image/png;base64,{base64.b64encode(data).decode()}"
