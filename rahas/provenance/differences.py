"""What differs between two states of a row, and which changes of recipes that comes from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from rahas.provenance.changes import Change, changes
from rahas.provenance.states import RowState

CHANGED, NEW, GONE = "changed", "new", "gone"
_SHOWN_ONLY = frozenset({"page", "verdict"})  # their inputs follow from the stages'


Definitions = Callable[[str], Mapping[str, str] | None]
"""From a code fingerprint to the digests of the definitions behind it, by ``module:name``; None: not known."""


class Cause(NamedTuple):
    """A change of recipe that does not merely follow from another one of the same row."""

    stage: str
    change: Change


class RowDifference(NamedTuple):
    """From one state of a row to another."""

    verdict: tuple[str, str]
    """Before and after; empty where there is none."""
    reasons: tuple[list[Mapping[str, Any]], list[Mapping[str, Any]]]
    """Reasons before and after; both empty where they are the same."""
    metrics: dict[str, tuple[Any, Any]]
    """Those that differ: before and after, ``None`` where not measured."""
    artifacts: dict[str, str]
    """Those whose bytes differ, by path: :data:`CHANGED`, :data:`NEW` or :data:`GONE`."""
    causes: list[Cause]
    """Why, in the order of the stages' names; may be there although nothing differs."""
    stages: frozenset[str]
    """Those whose recipes could be compared, as both sides have them."""

    @property
    def is_empty(self) -> bool:
        """Whether verdict, reasons, metrics and bytes are the same."""
        return self.verdict[0] == self.verdict[1] and not (any(self.reasons) or self.metrics or self.artifacts)


def difference(
    before: RowState,
    after: RowState,
    *,
    code: tuple[Definitions, Definitions] = (lambda _: None, lambda _: None),
) -> RowDifference:
    """Compare two states of a row; ``code`` tells the definitions behind the fingerprints of either side."""
    artifacts = _artifacts(before.artifacts, after.artifacts)
    stages = frozenset(before.records.keys() & after.records.keys())
    found = [
        Cause(stage, change)
        for stage in sorted(stages)
        for change in _own_changes((before, after), stage, artifacts, code)
    ]
    reasons = _list(before.qa, "reasons"), _list(after.qa, "reasons")
    return RowDifference(
        verdict=(_verdict(before.qa), _verdict(after.qa)),
        reasons=reasons if reasons[0] != reasons[1] else ([], []),
        metrics=_metrics(before.qa, after.qa),
        artifacts=artifacts,
        causes=found,
        stages=stages,
    )


def _own_changes(
    sides: tuple[RowState, RowState],
    stage: str,
    artifacts: Mapping[str, str],
    code: tuple[Definitions, Definitions],
) -> list[Change]:
    """Changes of a stage's recipe, without inputs that differ because an earlier stage of the row does."""
    was, now = (side.records[stage].recipe for side in sides)
    if was.key == now.key:
        return []
    found = changes(was, now, old_code=code[0](was.code), new_code=code[1](now.code))
    follows = {*sides[0].records, *sides[1].records, *artifacts}
    return [c for c in found if c.kind != "input" or not (stage in _SHOWN_ONLY or c.name in follows)]


def _artifacts(before: Mapping[str, str], after: Mapping[str, str]) -> dict[str, str]:
    words = {}
    for name in sorted({*before, *after}):
        if name not in before:
            words[name] = NEW
        elif name not in after:
            words[name] = GONE
        elif before[name] != after[name]:
            words[name] = CHANGED
    return words


def _metrics(before: Mapping[str, Any] | None, after: Mapping[str, Any] | None) -> dict[str, tuple[Any, Any]]:
    was, now = ((qa or {}).get("metrics") or {} for qa in (before, after))
    names = [*was, *(name for name in now if name not in was)]
    return {name: (was.get(name), now.get(name)) for name in names if was.get(name) != now.get(name)}


def _verdict(qa: Mapping[str, Any] | None) -> str:
    return "" if qa is None else str(qa.get("verdict", ""))


def _list(qa: Mapping[str, Any] | None, name: str) -> list[Mapping[str, Any]]:
    return list((qa or {}).get(name) or [])
