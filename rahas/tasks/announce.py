"""What is announced before anything runs: the results that are no longer current because the program has changed.

A new row or a replaced file speaks for itself. A library's new version, an edited function or a parameter does not:
it makes results of former runs outdated, perhaps of thousands of scans, and that is to be read before it is paid for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from rahas.provenance.changes import changes
from rahas.provenance.code import known_definitions
from rahas.provenance.fingerprints import CodeBase
from rahas.provenance.records import Recipe, Record
from rahas.stores.digests import digest_of_json

_MOST_LINES = 8
_MOST_STAGES = 12


class Now(NamedTuple):
    """What of a stage's recipe is known without looking at any file."""

    code: str
    params: Mapping[str, Any]
    libraries: Mapping[str, str]

    def is_that_of(self, recipe: Recipe) -> bool:
        """Whether the recipe was made of the same."""
        return (self.code, self.params, self.libraries) == (recipe.code, recipe.params, recipe.libraries)


class Outdated:
    """Stages of earlier runs that have to be computed again, by what changed; filled while the plan reads records."""

    def __init__(self, results: Path, code: CodeBase) -> None:
        self._results = results
        self._code = code
        self._texts: dict[tuple[str, str], list[str]] = {}
        self._scans: dict[str, set[str]] = {}
        self._stages: dict[str, dict[str, None]] = {}

    def add(self, scan_id: str, entry: str, record: Record, now: Now) -> None:
        """Note a stage (``entry``: its function) whose record fits no longer what would be done now."""
        for text in self._changed(entry, record.recipe, now):
            self._scans.setdefault(text, set()).add(scan_id)
            self._stages.setdefault(text, {})[record.recipe.stage] = None

    def lines(self, order: Iterable[str]) -> list[str]:
        """One line a change, stages in ``order``; empty where nothing changed."""
        if not self._scans:
            return []
        ranks = {stage: rank for rank, stage in enumerate(order)}
        lines = []
        for text, scans in self._scans.items():
            stages = sorted(self._stages[text], key=lambda stage: ranks.get(stage, len(ranks)))
            shown = ", ".join(stages[:_MOST_STAGES])
            lines.append(f"{text}: {shown} of {len(scans)} scan{'s' if len(scans) > 1 else ''} no longer current")
        hidden = len(lines) - _MOST_LINES
        more = [f"and {hidden} more changes (`rahas audit` lists them)"] if hidden > 0 else []
        return [
            *lines[:_MOST_LINES],
            *more,
            "These stages are computed again, and those whose inputs come out different.",
        ]

    def _changed(self, entry: str, was: Recipe, now: Now) -> list[str]:
        """The changes in words; the same for all scans that were made alike."""
        key = (entry, digest_of_json([was.code, was.params, was.libraries, now]))
        if key not in self._texts:
            new = Recipe(was.stage, was.inputs, was.columns, now.params, now.code, now.libraries)
            found = changes(
                was,
                new,
                old_code=known_definitions(self._results, was.code),
                new_code=self._code.definitions(entry) if was.code != now.code else None,
            )
            self._texts[key] = [change.text if change.name else "the code changed" for change in found]
        return self._texts[key]
