"""An expedition opened for work: its log and its configuration, checked, and what each row needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
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
        for entry in self.entries:
            if entry.scan_id == scan_id:
                return entry
        raise ExpeditionError(f"field_log.csv: no row with scan_id {scan_id!r}")

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
    included = _ids(options.get("include_rejected", ""))
    strangers = sorted(included - {e.scan_id for e in log.entries})
    if strangers:
        raise ExpeditionError(f"--config include_rejected: {strangers[0]!r} is no scan_id of field_log.csv")
    return Expedition(root, read_config(root), log.entries, log.skipped, included)


def _switch(name: str, value: Any) -> bool:
    text = str(value).strip().lower()
    if text not in ("true", "false", "1", "0", "yes", "no"):
        raise ExpeditionError(f"--config {name}: read {value!r}, expected true or false")
    return text in ("true", "1", "yes")


def _ids(value: Any) -> frozenset[str]:
    parts = value if isinstance(value, list | tuple) else str(value or "").split(",")
    return frozenset(str(p).strip() for p in parts if str(p).strip())
