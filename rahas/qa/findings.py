"""What a rule says: a reason to reject, or a warning; both have the same fields in qa.json."""

from __future__ import annotations

from typing import Any, NamedTuple

Finding = dict[str, Any]


class Findings(NamedTuple):
    """What a gate's rules say about a scan."""

    reasons: list[Finding]
    """Any of these rejects the scan."""
    warnings: list[Finding]
    """Worth knowing; the scan goes on."""


def finding(
    rule: str,
    metric: str,
    message: str,
    *,
    value: float | str | None = None,
    limit: float | str | None = None,
    unit: str = "",
) -> Finding:
    """One finding: ``message`` says what was found and what to do next time."""
    return {"rule": rule, "metric": metric, "value": value, "limit": limit, "unit": unit, "message": message}
