"""The help of every command as text in docs/reference/commands.md: `make commands`.

A repository shows the source of its pages, so the text stands there, after a comment that names the
command's module and what comes before `--help`. A test says when it is stale.
"""

import contextlib
import importlib
import io
import os
import re
from pathlib import Path
from unittest import mock

PAGE = Path(__file__).parent / "reference" / "commands.md"
_BLOCK = re.compile(r"(<!-- help: (\S+)((?: \S+)*) -->\n\n```text\n)(.*?)(```\n)", re.DOTALL)
_COLUMNS = 88
"""Width in characters: a page of furo, and one of a repository, hold as many."""


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


def written_anew(page: str) -> str:
    """Return a page with the help that its commands have now."""

    def block(found: re.Match[str]) -> str:
        head, module, arguments, _, tail = found.groups()
        return f"{head}{text(module, arguments.split())}{tail}"

    return _BLOCK.sub(block, page)


if __name__ == "__main__":
    PAGE.write_text(written_anew(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
