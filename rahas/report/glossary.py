"""docs/vocabulary.md from :mod:`rahas.vocabulary`: ``python -m rahas.report.glossary > docs/vocabulary.md``."""

from __future__ import annotations

import sys

from rahas.vocabulary import METRICS, QUANTITIES, Quantity


def vocabulary_markdown() -> str:
    """The vocabulary as one Markdown page: a table for each file, then the metrics."""
    lines = [
        "# Vocabulary",
        "",
        "Generated from `rahas/vocabulary.py` by `python -m rahas.report.glossary`; edit there, not here.",
        "",
        "Image x to the right, y down, pixel centres at integers. World frame: the target's, x right, y up, z towards",
        "the camera, mm. Phase grows downwards in the image. The thesis is Crane (2011).",
    ]
    for file in dict.fromkeys(quantity.found_in for quantity in QUANTITIES):
        lines += ["", f"## {file}", ""]
        lines += [
            "| name | symbol | thesis | dims | unit | type | range | definition |",
            "|---|---|---|---|---|---|---|---|",
        ]
        lines += [_row(quantity) for quantity in QUANTITIES if quantity.found_in == file]
    lines += ["", "## Metrics (qa.json, scans.csv)", "", "| name | label | unit | definition |", "|---|---|---|---|"]
    lines += [f"| `{m.name}` | {m.label} | {m.unit or '1'} | {m.definition} |" for m in METRICS]
    return "\n".join(lines) + "\n"


def _row(quantity: Quantity) -> str:
    dims = ", ".join(quantity.dims) or "—"
    kind = quantity.dtype.replace("|", " or ")
    cells = [
        f"`{quantity.name}`",
        quantity.symbol,
        quantity.thesis_symbol,
        dims,
        quantity.unit,
        kind,
        _interval(quantity),
    ]
    return "| " + " | ".join([*cells, quantity.definition]) + " |"


def _interval(quantity: Quantity) -> str:
    if quantity.low is None and quantity.high is None:
        return "any"
    low = "−∞" if quantity.low is None else f"{quantity.low:.4g}"
    high = "∞" if quantity.high is None else f"{quantity.high:.4g}"
    return f"{low} … {high}".replace("-", "−")


if __name__ == "__main__":
    sys.stdout.write(vocabulary_markdown())
