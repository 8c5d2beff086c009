"""What was done, step by step, as plain values: what the exports (crate, table) are made from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class Artifact(NamedTuple):
    """A file or a folder that a step read or made."""

    path: str
    """From the expedition's folder, with slashes."""
    sha256: str
    """Of the bytes; of a store, of its manifest; of another folder, of the list of its files' digests."""
    folder: bool = False
    size: int | None = None
    """Bytes that lie there now; ``None`` where nothing does."""

    @property
    def name(self) -> str:
        """Its last part: ``phase.zarr``."""
        return self.path.rsplit("/", 1)[-1]

    @property
    def is_store(self) -> bool:
        """Whether it is a zarr store, whose manifest names all its files."""
        return self.folder and self.path.endswith(".zarr")


class Action(NamedTuple):
    """One stage of one row, done."""

    scan_id: str
    stage: str
    entry: str
    """``module:function`` of the code."""
    outcome: str
    """As in the record: made, problem or withdrawn."""
    inputs: tuple[Artifact, ...]
    outputs: tuple[Artifact, ...]
    parameters: Mapping[str, Any]
    """By name, sections and columns of the log joined by dots."""
    code: str
    """Fingerprint."""
    libraries: Mapping[str, str]
    rahas: str
    """Version of this project."""
    message: str = ""
    """Why the capture could not be used."""
    began: str | None = None
    """ISO 8601; ``None`` where no companion of the record tells."""
    ended: str | None = None
    host: str | None = None
    commit: str | None = None
    """Commit of the project, followed by ``(edited)`` where its tree was not clean."""

    @property
    def key(self) -> str:
        """``scan_id/stage``."""
        return f"{self.scan_id}/{self.stage}"
