"""The lines that close a run in the terminal: how many of what, and why."""

from __future__ import annotations

from collections.abc import Sequence

from rahas.report.pages import Card
from rahas.report.words import VERDICT_WORDS, deciding_findings, finding_line, plain


def closing_lines(cards: Sequence[Card]) -> str:
    """Counts first, then a line for each row that has no accepted result, with its reasons; plain text."""
    counts = ", ".join(
        f"{count} {label}"
        for verdict, label in VERDICT_WORDS.items()
        if (count := sum(card.verdict == verdict for card in cards)) or verdict != ""
    )
    lines = [f"{len(cards)} captures: {counts}"]
    width = max((len(str(card.row["scan_id"])) for card in cards), default=0)
    for card in cards:
        why = _why(card)
        if card.verdict != "accepted" or why:
            label = VERDICT_WORDS.get(card.verdict, card.verdict)
            lines.append(f"  {card.row['scan_id']!s:<{width}}  {label:<13}  {why}".rstrip())
    lines.append("Pages: results/index.html    Table: results/scans.csv")
    return "\n".join(lines)


def _why(card: Card) -> str:
    if card.qa is None:
        return "its job failed or has not run; the same command tries again"
    deciding = "; ".join(
        plain(f"{finding.get('rule', '')}: {finding_line(finding)}") for finding in deciding_findings(card.qa)
    )
    if card.qa.get("overridden"):
        return f"let through by include_rejected; {deciding}".removesuffix("; ")
    return deciding
