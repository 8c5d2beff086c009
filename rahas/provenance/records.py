"""A record beside every artifact: what it was made from, by which code, with which parameters.

Records hold no clock and no host, so equal work gives equal records. The record is written last: without a record
there is no artifact.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rahas import __version__
from rahas.stores.atomic import read_json, write_text
from rahas.stores.digests import digest_of_json

SCHEMA = 2

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
        return digest_of_json(vars(self))


@dataclass(frozen=True)
class Record:
    """What became of a recipe."""

    recipe: Recipe
    outcome: str
    outputs: Mapping[str, str] = field(default_factory=dict)  # path below the scan's folder -> digest
    reason: Mapping[str, Any] | None = None
    rahas: str = __version__
    schema: int = SCHEMA

    @property
    def seal(self) -> str:
        """Digest of all that the record says: an edit of the file breaks it."""
        return digest_of_json(self._content())

    def text(self) -> str:
        """The one text of the record's file, so that no byte of it can change unseen."""
        content = self._content()
        whole = {**content, "seal": digest_of_json(content)}
        return json.dumps(whole, indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    def _content(self) -> dict[str, Any]:
        return {**vars(self), "recipe": vars(self.recipe), "key": self.recipe.key}

    def write(self, path: Path) -> None:
        """Write the record atomically."""
        write_text(path, self.text())


def read_record(path: Path) -> Record | None:
    """Read a record; ``None`` where there is none, or none of this schema."""
    try:
        raw = read_json(path)
        if raw["schema"] != SCHEMA:
            return None
        del raw["key"], raw["seal"]
        return Record(**{**raw, "recipe": Recipe(**raw["recipe"])})
    except (OSError, ValueError, KeyError, TypeError):
        return None


def library_versions(*names: str) -> dict[str, str]:
    """Installed versions of the libraries that can change a stage's numbers."""
    return {name: _version(name) for name in sorted(names)}


@lru_cache
def _version(name: str) -> str:
    return version(name)  # reads and parses a file: once a process, not once a stage and row
