"""Numbers and findings in words: what a page, the index and the terminal say alike."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rahas.vocabulary import METRICS

VERDICT_WORDS = {
    "accepted": "accepted",
    "rejected": "rejected",
    "not_processed": "not processed",
    "": "not finished",
}
_SUFFIX_UNITS = {"mm": "mm", "px": "px", "rad": "rad", "mrad": "mrad", "deg": "°", "s": "s", "share": "share"}


def number(value: float, *, span: float | None = None) -> str:
    """A number to read: three digits of ``value``, or as many decimals as three digits of ``span`` need; true minus."""
    if not math.isfinite(value):
        return "—"
    size = abs(value) if span is None else abs(span)
    decimals = 0 if size == 0 else max(0, 2 - math.floor(math.log10(size)))
    text = f"{value:.{min(decimals, 6)}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text.replace("-", "−")


def value_text(value: Any, unit: str = "") -> str:
    """A metric's value with its unit; — where there is none."""
    if value is None or value == "":
        return "—"
    if isinstance(value, bool):
        return "yes" if value else "no"
    text = number(float(value)) if isinstance(value, int | float) else str(value)
    return f"{text}\u202f{unit}" if unit else text


def metric_label(name: str) -> str:
    """What a metric is called on a page."""
    known = {metric.name: metric.label for metric in METRICS}
    return known.get(name, name.replace("_", " "))


def metric_unit(name: str) -> str:
    """Unit of a metric: the vocabulary's, else what the name ends with."""
    for metric in METRICS:
        if metric.name == name:
            return metric.unit
    ending = name.rsplit("_", 1)[-1] if "_" in name else ""
    return _SUFFIX_UNITS.get(ending, "")


def metric_meaning(name: str) -> str:
    """Definition of a metric, empty where the vocabulary has none."""
    return next((metric.definition for metric in METRICS if metric.name == name), "")


def finding_line(finding: Mapping[str, Any]) -> str:
    """A reason or warning in one line: its message, else the bare numbers."""
    message = str(finding.get("message") or "").strip()
    return message or measured_against(finding)


def measured_against(finding: Mapping[str, Any]) -> str:
    """``jitter 3.41 px, limit 1 px``, after the rule where the metric has another name; the rule alone if no value."""
    rule, metric = str(finding.get("rule") or ""), str(finding.get("metric") or "")
    if finding.get("value") is None:
        return rule
    unit = str(finding.get("unit") or "")
    text = f"{metric_label(metric)} {value_text(finding['value'], unit)}"
    if finding.get("limit") is not None:
        text += f", limit {value_text(finding['limit'], unit)}"
    return text if metric == rule else f"{rule}: {text}"


def verdict_of(qa: Mapping[str, Any] | None) -> str:
    """Verdict of a qa.json; empty for a row that has none yet."""
    return "" if qa is None else str(qa.get("verdict", ""))
