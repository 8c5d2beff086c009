"""A record beside every artifact: what it was made from, by which code, with which parameters.

Records hold no clock and no host, so equal work gives equal records. The record is written last: without a record
there is no artifact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rahas import __version__
from rahas.stores.atomic import read_json, write_json
from rahas.stores.digests import digest_of_json

SCHEMA = 1

MAKING = "making"  # being made, or its maker was killed: there is no artifact
MADE = "made"
PROBLEM = "problem"  # the capture cannot be used: ``reason`` says why
WITHDRAWN = "withdrawn"  # made once, taken away again because the scan was rejected later on


@dataclass(frozen=True)
class Recipe:
    """Everything that decides what a stage's output is; equal recipes give equal bytes."""

    stage: str
    inputs: Mapping[str, str]  # name -> digest
    columns: Mapping[str, Any]  # those of the log row that the stage reads
    params: Mapping[str, Any]
    code: str
    libraries: Mapping[str, str]

    @property
    def key(self) -> str:
        """Digest of the recipe's canonical form."""
        return digest_of_json(asdict(self))


@dataclass(frozen=True)
class Record:
    """What became of a recipe."""

    recipe: Recipe
    outcome: str
    outputs: Mapping[str, str] = field(default_factory=dict)  # path below the scan's folder -> digest
    reason: Mapping[str, Any] | None = None
    rahas: str = __version__
    schema: int = SCHEMA

    def write(self, path: Path) -> None:
        """Write the record atomically."""
        write_json(path, {**asdict(self), "key": self.recipe.key})


def read_record(path: Path) -> Record | None:
    """Read a record; ``None`` where there is none, or none of this schema."""
    try:
        raw = read_json(path)
        if raw["schema"] != SCHEMA:
            return None
        raw.pop("key")
        return Record(**{**raw, "recipe": Recipe(**raw["recipe"])})
    except (OSError, ValueError, KeyError, TypeError):
        return None


def library_versions(*names: str) -> dict[str, str]:
    """Installed versions of the libraries that can change a stage's numbers."""
    return {name: version(name) for name in sorted(names)}
