"""Places where long paths and names in inline code may break: a narrow table needs them."""

import re
from typing import Any

from sphinx.application import Sphinx

_INLINE = re.compile(r'(?<=<span class="pre">)[^<]+(?=</span>)')
_JOINT = re.compile(r"(?<=\w)([/_+])(?=\w)")


def breakable(html: str) -> str:
    """Return a page's HTML with a `<wbr>` behind slashes, underscores and plus signs in code."""
    return _INLINE.sub(lambda found: _JOINT.sub(r"\1<wbr>", found[0]), html)


def _page(app: Any, name: str, template: str, context: dict[str, Any], tree: Any) -> None:
    if "body" in context:
        context["body"] = breakable(context["body"])


def setup(app: Sphinx) -> dict[str, Any]:
    """Change every page before it is written."""
    app.connect("html-page-context", _page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
