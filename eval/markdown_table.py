"""Markdown tables, aligned so that they also read well in a terminal."""

from collections.abc import Collection, Sequence

ABSENT = "–"  # text of a cell that has no value


def aligned(lines: Sequence[Sequence[str]], texts: Collection[int] = (0,)) -> str:
    """Return a Markdown table with columns of equal width.

    Args:
        lines: cells of the header, then of each row; all lines have equally many.
        texts: indices of the text columns, which are flush left; number columns are flush right.
    """
    # A bar inside a cell would end the cell.
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
