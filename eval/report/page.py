"""The report as one self-contained HTML page: sections of numbers, figures and examples."""

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import jinja2
from markdown_it import MarkdownIt
from markupsafe import Markup

from lime_keras.version import __version__, installed

from .themes import DARK, LIGHT, Theme

_TEMPLATES = Path(__file__).parent / "templates"
_VERSIONS = {"tensorflow": "TensorFlow", "keras": "Keras", "onnxruntime": "ONNX Runtime"}
"""Packages whose versions a section names, with their names in words."""


@dataclass(frozen=True)
class Picture:
    """A figure of a section.

    Attributes:
        draw: function from a theme to a PNG, or to None if there is nothing to draw.
        alt: description of the figure for readers who cannot see it.
        caption: text below the figure.
    """

    draw: Callable[[Theme], bytes | None]
    alt: str
    caption: str


def measured(title: str, text: str, pictures: Sequence[Picture], *, command: str) -> str:
    """Return a section of figures and Markdown as HTML.

    Args:
        title: heading of the section.
        text: Markdown below the figures; its tables become sortable.
        pictures: figures of the section.
        command: command that made the section, as typed.
    """
    drawn = [(both_themes(p.draw), p.alt, p.caption) for p in pictures]
    html = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    html = html.replace("<table>", '<div class="wide"><table>')
    return rendered(
        "measured.html",
        title=title,
        command=command,
        figures=[one for one in drawn if one[0] is not None],
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
    """Return a template of the report as HTML.

    Args:
        template: name of the file in `templates/`.
        values: what the template shows, by name.
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
    return environment.get_template(template).render(
        made=date.today().isoformat(),
        versions=", ".join([f"lime_keras {__version__}", *versions]),
        **values,
    )


def both_themes(draw: Callable[[Theme], bytes | None]) -> dict[str, str] | None:
    """Return the figure for a light and a dark page as data URIs; None if there is no figure."""
    light, dark = draw(LIGHT), draw(DARK)
    if light is None or dark is None:
        return None
    return {"light": data_uri(light), "dark": data_uri(dark)}


def data_uri(data: bytes) -> str:
    """Return a PNG as a data URI."""
    return f"data:image/png;base64,{base64.b64encode(data).decode()}"
