"""From the two gates, the log and the operator's override to the content of qa.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rahas.qa.findings import finding

Review = Mapping[str, Any]


def verdict(
    scan_id: str,
    *,
    decision: str,
    processed: bool,
    overridden: bool,
    capture: Review | None = None,
    result: Review | None = None,
    problem: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The content of qa.json.

    Parameters
    ----------
    decision
        The operator's own: ``keep``, ``reject`` or empty.
    processed
        False for a scan that the operator rejected and nobody asked for.
    overridden
        ``include_rejected`` names the scan: gates do not stop it; its findings are kept as warnings, and it is marked.
    capture, result
        The review files of the gates that were passed through or failed.
    problem
        What a stage found, where one could not go on: it always rejects.
    """
    reviews = [review for review in (capture, result) if review is not None]
    found = [reason for review in reviews for reason in review.get("reasons", [])]
    warnings = [warning for review in reviews for warning in review.get("warnings", [])]
    if not processed:
        message = f"The operator rejected this scan in the notebook; --config include_rejected={scan_id} processes it."
        outcome, reasons = "not_processed", [finding("operator", "decision", message, value=decision, limit="keep")]
    else:
        reasons = [] if overridden else list(found)
        if overridden:
            warnings = [{**reason, "waived": True} for reason in found] + warnings
        if problem is not None:
            reasons.insert(0, dict(problem))
        outcome = "rejected" if reasons else "accepted"
    return {
        "scan_id": scan_id,
        "verdict": outcome,
        "gate": "capture" if result is None else "result",
        "reasons": reasons,
        "warnings": warnings,
        "metrics": _metrics(capture, result),
        "decision": decision,
        "overridden": bool(processed and overridden),
    }


def _metrics(capture: Review | None, result: Review | None) -> dict[str, Any]:
    """Metrics of both gates; where both measured the same, the later one counts and the earlier is kept beside it."""
    metrics = dict((capture or {}).get("metrics", {}))
    for name, value in ((result or {}).get("metrics") or {}).items():
        if name in metrics:
            metrics[f"{name}_of_capture"] = metrics[name]
        metrics[name] = value
    return metrics
