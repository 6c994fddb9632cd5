"""What the paper concludes from its Table 1 and Figure 7, judged by runs of the same recipe."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..markdown_table import aligned
from .measures import MEASURES

FULL = "full approach"


@dataclass(frozen=True)
class Claim:
    """A claim that a row has a higher or a lower value of a measure than the full approach.

    Attributes:
        text: the claim in words.
        row: row of the paper's table.
        measure: name out of `MEASURES`.
        rises: whether the row's value is said to be the higher one.
    """

    text: str
    row: str
    measure: str
    rises: bool


CLAIMS = (
    Claim("Eq. 5 lowers the error of m_d", "without perceptual loss", "diffuse_albedo_mae", True),
    Claim("Eq. 5 lowers the error of m_s", "without perceptual loss", "specular_albedo_mae", True),
    Claim("MirrorNet finds more right bins", "without MirrorNet", "exponent_exact", False),
    Claim("MirrorNet lowers the error of log10 s", "without MirrorNet", "log_exponent_mae", True),
    Claim("regression finds fewer right bins", "exponent regression", "exponent_exact", False),
    Claim("regression errs less in log10 s", "exponent regression", "log_exponent_mae", False),
    Claim("regression is biased to specular", "exponent regression", "log_exponent_bias", True),
    Claim("a reflectance map loses the exponent", "reflectance map", "exponent_exact", False),
    Claim("a reflectance map finds m_d better", "reflectance map", "diffuse_albedo_mae", False),
    Claim("a reflectance map finds m_s better", "reflectance map", "specular_albedo_mae", False),
)
"""The claims of section 6.1 and its table, and of Figure 7."""


def judge(
    drawn: Mapping[str, Sequence[Mapping[str, np.ndarray]]],
    printed: Mapping[str, Mapping[str, float]],
) -> list[dict[str, Any]]:
    """Judge each claim whose two rows have runs; return the rows of the table of claims.

    A claim holds, or does not, if the paired 95 % interval over the images of the difference of the
    rows' means over runs excludes 0, and all pairs of runs agree in its sign. Else it cannot be
    told.

    Args:
        drawn: measures on the bootstrap samples (`measures.resampled`) of the runs of each row.
        printed: the paper's values by row and measure.

    Returns:
        For each such claim its `claim`, `measure`, the `paper`'s values of the full approach and of
        the row where they are printed, `ours` alike, the `interval` of the difference, the number
        of `pairs` of runs, and the `verdict`.
    """
    verdicts = []
    for claim in CLAIMS:
        name = claim.measure
        rows = [
            [run[name] for run in drawn.get(row, ()) if name in run] for row in (FULL, claim.row)
        ]
        if not all(rows):
            continue
        full, other = (np.mean(runs, axis=0) for runs in rows)
        low, high = np.percentile(other - full, (2.5, 97.5))
        signs = {float(np.sign(b.mean() - a.mean())) for a in rows[0] for b in rows[1]}
        cells = [printed[row].get(name) for row in (FULL, claim.row)]
        is_clear = (low > 0 or high < 0) and len(signs) == 1
        verdicts.append(
            {
                "claim": claim.text,
                "measure": name,
                "paper": cells if None not in cells else None,
                "ours": [float(full.mean()), float(other.mean())],
                "interval": [float(low), float(high)],
                "pairs": len(rows[0]) * len(rows[1]),
                "verdict": ("holds" if (low > 0) == claim.rises else "does not")
                if is_clear
                else "cannot be told",
            }
        )
    return verdicts


def markdown(judged: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of claims in Markdown; nothing if no claim can be judged."""
    if not judged:
        return ""
    lines = [("Claim", "Measure", "Paper: full → without", "Ours", "Difference (95 %)", "Verdict")]
    for one in judged:
        measure = MEASURES[one["measure"]]
        scale, digits = measure.unit.scale, measure.unit.digits
        low, high = (f"{scale * end:+.{digits}f}" for end in one["interval"])
        lines.append(
            (
                one["claim"],
                measure.short,
                "not printed" if one["paper"] is None else _arrow(measure, one["paper"]),
                _arrow(measure, one["ours"]),
                f"{low} … {high}",
                one["verdict"],
            )
        )
    return f"What the paper concludes, by runs of its recipe:\n\n{aligned(lines)}"


def _arrow(measure: Any, pair: Sequence[float]) -> str:
    return " → ".join(measure.unit.number(value) for value in pair)
