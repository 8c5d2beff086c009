"""An expedition opened for work: its log and its configuration, checked, and what each row needs."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from rahas.errors import ExpeditionError
from rahas.params import Config
from rahas.stores.config import read_config
from rahas.stores.field_log import Entry, read_field_log
from rahas.stores.layout import ScanFolder

OPTIONS = ("include_rejected", "skip_bad_rows")


@dataclass(frozen=True)
class Expedition:
    """The field log, the configuration and the command line's wishes."""

    root: Path
    config: Config
    entries: tuple[Entry, ...]
    skipped: tuple[str, ...] = ()
    include_rejected: frozenset[str] = field(default_factory=frozenset)

    @cached_property
    def _by_id(self) -> dict[str, Entry]:
        return {entry.scan_id: entry for entry in self.entries}

    @cached_property
    def sections(self) -> dict[str, Any]:
        """The configuration as plain values."""
        return self.config.model_dump(mode="json")

    @property
    def results(self) -> Path:
        return self.root / "results"

    @property
    def captures(self) -> Path:
        return self.root / "captures"

    @property
    def target(self) -> Path:
        return self.root / "config" / "target.csv"

    def entry(self, scan_id: str) -> Entry:
        """The row of a scan.

        Raises
        ------
        ExpeditionError
            The log has no such row.
        """
        if scan_id not in self._by_id:
            raise ExpeditionError(f"field_log.csv: no row with scan_id {scan_id!r}")
        return self._by_id[scan_id]

    def scan(self, scan_id: str) -> ScanFolder:
        return ScanFolder(self.results, scan_id)

    def is_processed(self, entry: Entry) -> bool:
        """The operator did not reject it, or it was asked for all the same."""
        return entry.decision != "reject" or entry.scan_id in self.include_rejected


def open_expedition(root: Path, options: Mapping[str, Any] | None = None) -> Expedition:
    """Read and check the log and the configuration of the expedition at ``root``.

    Raises
    ------
    ExpeditionError
        The log, the configuration or an option cannot be trusted.
    """
    options = dict(options or {})
    unknown = sorted(set(options) - set(OPTIONS))
    if unknown:
        raise ExpeditionError(
            f"--config: unknown key {unknown[0]!r}; read {', '.join(unknown)}, expected one of {', '.join(OPTIONS)} "
            "(parameters of the stages stand in config/config.yaml)"
        )
    log = read_field_log(root, skip_bad_rows=_switch("skip_bad_rows", options.get("skip_bad_rows", False)))
    included = _ids(options.get("include_rejected", ""), {entry.scan_id for entry in log.entries})
    strangers = sorted(included - {e.scan_id for e in log.entries})
    if strangers:
        raise ExpeditionError(f"--config include_rejected: {strangers[0]!r} is no scan_id of field_log.csv")
    return Expedition(root, read_config(root), log.entries, log.skipped, included)


def check_writable(expedition: Expedition) -> None:
    """Raise ExpeditionError where results/, or a scan's folder in it, is there and may not be written."""
    scans = (expedition.scan(entry.scan_id) for entry in expedition.entries)
    for folder in (expedition.results, *(place for scan in scans for place in (scan.path, scan.records))):
        if folder.exists() and not (folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)):
            found = "no permission to write there" if folder.is_dir() else "a file of that name"
            shown = folder.relative_to(expedition.root)
            raise ExpeditionError(f"{shown}: found {found}, expected a folder that results can be written into")


def _switch(name: str, value: Any) -> bool:
    text = str(value).strip().lower()
    if text not in ("true", "false", "1", "0", "yes", "no"):
        raise ExpeditionError(f"--config {name}: read {value!r}, expected true or false")
    return text in ("true", "1", "yes")


def _ids(value: Any, known: set[str]) -> frozenset[str]:
    """The ids asked for; Snakemake reads an id like 001 as a number, which is taken back."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        alike = {scan_id for scan_id in known if _as_number(scan_id) == value}
        return frozenset(alike) if len(alike) == 1 else frozenset([str(value)])
    parts = value if isinstance(value, list | tuple) else str(value or "").split(",")
    return frozenset(str(p).strip() for p in parts if str(p).strip())


def _as_number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
