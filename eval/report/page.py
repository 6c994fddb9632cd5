"""The report as one self-contained HTML page: sections of numbers, figures and examples."""

import base64
import io
from collections.abc import Iterable, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markdown_it import MarkdownIt
from markupsafe import Markup
from matplotlib import image as png_writer

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
        figures=pictures,
        text=Markup(html.replace("</table>", "</table></div>")),
    )


def whole(sections: Sequence[tuple[str, str, str]]) -> str:
    """Return the report of sections, each (name, title, HTML), as HTML that needs no other file."""
    shown = [{"name": name, "title": title, "html": Markup(html)} for name, title, html in sections]
    return rendered("report.html", sections=shown)


def rendered(template: str, **values: Any) -> str:
    """Return a file of `templates/`, filled with values by name, as HTML.

    Its filter `uri` takes PNGs, and images `(H, W, 3)`, sRGB in [0, 1].
    """
    known = installed(_VERSIONS)
    versions = [f"{name} {known[package]}" for package, name in _VERSIONS.items() if known[package]]
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["uri"] = _uri
    return environment.get_template(template).render(
        made=date.today().isoformat(),
        versions=", ".join([f"lime_keras {__version__}", *versions]),
        **values,
    )


def _uri(picture: bytes | np.ndarray) -> str:
    """Return a PNG, or an image as PNG, as a data URI."""
    if not isinstance(picture, bytes):
        buffer = io.BytesIO()
        png_writer.imsave(buffer, np.clip(picture, 0.0, 1.0), format="png")
        picture = buffer.getvalue()
    return f"data:image/png;base64,{base64.b64encode(picture).decode()}"
