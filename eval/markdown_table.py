"""Markdown tables, aligned so that they also read well in a terminal."""

from collections.abc import Collection, Sequence

ABSENT = "–"
"""Stands for a number that there is none of."""


def aligned(lines: Sequence[Sequence[str]], texts: Collection[int] = (0,)) -> str:
    """A table of a header and rows.

    Args:
        lines: cells, the header's first, as many in each.
        texts: columns that are flush left; the others, of numbers, are flush right.
    """
    # A bar in a cell's words would end the cell.
    cells = [[cell.replace("|", "\\|") for cell in line] for line in lines]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    rule = [
        "-" * (width + 2) if column in texts else "-" * (width + 1) + ":"
        for column, width in enumerate(widths)
    ]
    header, *rows = (
        " | ".join(
            cell.ljust(width) if column in texts else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        for line in cells
    )
    return "\n".join([f"| {header} |", f"|{'|'.join(rule)}|", *(f"| {row} |" for row in rows)])
