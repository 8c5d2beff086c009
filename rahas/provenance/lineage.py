"""The graph of what was made from what, over the records of an expedition."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from rahas.provenance.records import MADE, Recipe, Record

Key = tuple[str, str]
"""(scan_id, stage); the index and the table are (``expedition``, ``summary``)."""


class Source(NamedTuple):
    """One thing that a step was made from."""

    name: str
    """Of the recipe's input."""
    step: Key | None
    """The step that made it; None for a raw file that nobody makes."""
    path: str | None
    """Of a raw file, from the expedition's folder; None for what a step before it leaves."""


@dataclass(frozen=True)
class Step:
    """One stage of one scan: what it should have left, what it did leave, and from what."""

    key: Key
    entry: str
    """``module:function`` of the code that makes it."""
    folder: Path
    """The folder that the record's paths start from."""
    shown: str
    """The same from the expedition's folder, with a slash at its end, to be read."""
    record_path: Path
    record: Record | None
    outputs: tuple[str, ...]
    """What the stage makes, below ``folder``."""
    kept: bool | None
    """Whether its artifacts should lie there; None where they may (a scan that is not finished)."""
    sources: tuple[Source, ...] = ()
    recipe: Callable[[], Recipe] | None = None
    """Its recipe as it would be now; None where its record is not a part of the present result."""

    @property
    def made(self) -> Record | None:
        """Its record, where that speaks of artifacts."""
        return self.record if self.record is not None and self.record.outcome == MADE else None

    def artifacts(self) -> list[str]:
        """Its artifacts from the expedition's folder; a folder of pictures counts as one."""
        names = self.made.outputs if self.made else ()
        own = {next((o for o in self.outputs if name.startswith(f"{o}/")), name) for name in names}
        return sorted(self.shown + name for name in own)


Steps = Mapping[Key, Step]


def ancestry(steps: Steps, keys: Iterable[Key]) -> set[Key]:
    """The steps of ``keys`` and all that they were made from."""
    found: set[Key] = set()
    pending = list(keys)
    while pending:
        key = pending.pop()
        if key in steps and key not in found:
            found.add(key)
            pending += [source.step for source in steps[key].sources if source.step is not None]
    return found


def dependents(steps: Steps, keys: Iterable[Key], paths: Iterable[str] = ()) -> list[Key]:
    """The steps that were made from those of ``keys``, or from the raw files ``paths``; in the order of ``steps``."""
    wanted, raw = set(keys), set(paths)
    found: set[Key] = set()
    grew = True
    while grew:
        grew = False
        for key, step in steps.items():
            if key in found or step.record is None:
                continue
            if any(s.step in wanted or s.step in found or s.path in raw for s in step.sources):
                found.add(key)
                grew = True
    return [key for key in steps if key in found - wanted]
