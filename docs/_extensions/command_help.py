"""The directive `command-help`: what a command's `--help` says, asked when the site is built."""

import contextlib
import importlib
import io
import os
from typing import Any
from unittest import mock

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

_COLUMNS = 88
"""Width in characters: a page of furo holds as many without a scroll bar."""


def text(module: str, arguments: list[str], columns: int = _COLUMNS) -> str:
    """Return the help of a command.

    Args:
        module: module of the command, which has a function `main`.
        arguments: what stands before `--help`, such as a subcommand.
        columns: width of the text in characters.
    """
    main = importlib.import_module(module).main
    out = io.StringIO()
    plain = {"COLUMNS": str(columns), "NO_COLOR": "1"}
    with mock.patch.dict(os.environ, plain), contextlib.redirect_stdout(out):
        with contextlib.suppress(SystemExit):
            main([*arguments, "--help"])
    return out.getvalue()


class CommandHelp(SphinxDirective):
    """A block with a command's help: its module, then the arguments before `--help`."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """Return the block."""
        module, *arguments = self.arguments[0].split()
        shown = text(module, arguments)
        block = nodes.literal_block(shown, shown)
        block["language"] = "text"
        return [block]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
