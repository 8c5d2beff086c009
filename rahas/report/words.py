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
_OF_CAPTURE = "_of_capture"  # where both gates measure the same, what the first one found
_SUFFIX_UNITS = {"mm": "mm", "px": "px", "rad": "rad", "mrad": "mrad", "deg": "°", "s": "s"}


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
    if name.endswith(_OF_CAPTURE):
        return f"{metric_label(name.removesuffix(_OF_CAPTURE))}, of the capture"
    known = {metric.name: metric.label for metric in METRICS}
    ending = name.rpartition("_")[2]
    bare = name.removesuffix(f"_{ending}") if _SUFFIX_UNITS.get(ending) else name
    return known.get(name, bare.replace("_", " "))


def metric_unit(name: str) -> str:
    """Unit of a metric: the vocabulary's, else what the name ends with."""
    name = name.removesuffix(_OF_CAPTURE)
    for metric in METRICS:
        if metric.name == name:
            return metric.unit
    return _SUFFIX_UNITS.get(name.rpartition("_")[2], "") if "_" in name else ""


def metric_meaning(name: str) -> str:
    """Definition of a metric, empty where the vocabulary has none."""
    return next((metric.definition for metric in METRICS if metric.name == name), "")


def finding_line(finding: Mapping[str, Any]) -> str:
    """A reason or warning in one line: its message, else the bare numbers."""
    return str(finding.get("message") or "").strip() or measured_against(finding)


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


def deciding_findings(qa: Mapping[str, Any] | None) -> list[Mapping[str, Any]]:
    """The reasons of a verdict; of a scan that was let through also those that were waived."""
    qa = qa or {}
    return [*qa.get("reasons", []), *(warning for warning in qa.get("warnings", []) if warning.get("waived"))]


def verdict_of(qa: Mapping[str, Any] | None) -> str:
    """Verdict of a qa.json; empty for a row that has none yet."""
    return "" if qa is None else str(qa.get("verdict", ""))


def plain(text: str) -> str:
    """One line without control characters: what is in a file's name must not steer a terminal."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
