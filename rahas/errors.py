"""The two kinds of bad input: an expedition that cannot be trusted, and a capture that cannot be used."""

from __future__ import annotations

from typing import Any


class ExpeditionError(Exception):
    """The field log or the configuration cannot be trusted as a whole: refused before anything runs.

    The message names file, row, column, what was read and what is expected.
    """


class CaptureProblem(Exception):
    """A capture cannot be used: its scan is rejected with this reason, and every other scan goes on.

    ``rule`` and ``metric`` are the QA vocabulary's; ``value`` and ``limit`` may be ``None`` where the
    finding is not a number; ``message`` tells a field archaeologist what was found and what to do next time.
    """

    def __init__(
        self,
        rule: str,
        metric: str,
        message: str,
        *,
        value: float | str | None = None,
        limit: float | str | None = None,
        unit: str = "",
    ) -> None:
        super().__init__(message)
        self.rule = rule
        self.metric = metric
        self.value = value
        self.limit = limit
        self.unit = unit
        self.message = message

    def as_reason(self) -> dict[str, Any]:
        """The reason as it stands in qa.json."""
        return {
            "rule": self.rule,
            "metric": self.metric,
            "value": self.value,
            "limit": self.limit,
            "unit": self.unit,
            "message": self.message,
        }
