"""results/scans.csv: one row per row of the field log, verdict and reasons first, then every metric."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from rahas.report.pages import Card
from rahas.report.words import deciding_findings, finding_line
from rahas.vocabulary import METRICS

FIXED_COLUMNS = ("scan_id", "site", "role", "decision", "verdict", "rule", "message")


def scans_csv(cards: Sequence[Card]) -> str:
    """The table as CSV text. Empty cells: a verdict that is not there yet, a metric that is null or not measured.

    Several reasons stand in one cell, separated by ``; ``; of a scan that was let through, those that were waived.
    Metrics in the vocabulary come first, others by name.
    """
    metrics = metric_columns(cards)
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*FIXED_COLUMNS, *metrics])
    for card in cards:
        reasons = deciding_findings(card.qa)
        values = card.qa.get("metrics", {}) if card.qa else {}
        row = [card.row["scan_id"], card.row["site"], card.row["role"], card.row["decision"], card.verdict]
        row += ["; ".join(str(r.get("rule", "")) for r in reasons), "; ".join(_message(r) for r in reasons)]
        writer.writerow([*row, *(_cell(values.get(name)) for name in metrics)])
    return text.getvalue()


def metric_columns(cards: Sequence[Card]) -> list[str]:
    """Metric names that any row has; a metric never hides a fixed column."""
    found = {name for card in cards if card.qa for name in card.qa.get("metrics", {})} - set(FIXED_COLUMNS)
    known = [metric.name for metric in METRICS if metric.name in found]
    return known + sorted(found - set(known))


def _message(finding: Mapping[str, Any]) -> str:
    return f"Let through: {finding_line(finding)}" if finding.get("waived") else finding_line(finding)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return repr(value) if isinstance(value, float) else str(value)
