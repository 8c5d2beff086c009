"""What is known of one row of the log after a run: its verdict, its artifacts by digest, its records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

from rahas.provenance.companions import SUFFIX
from rahas.provenance.records import MADE, SCHEMA, Recipe, Record
from rahas.stores.atomic import read_json
from rahas.stores.digests import digest_of_path
from rahas.stores.field_log import RESERVED_IDS
from rahas.stores.layout import ScanFolder


class RowState(NamedTuple):
    """One row after one run."""

    qa: Mapping[str, Any] | None
    """Its qa.json; ``None`` for a row that has no verdict."""
    records: Mapping[str, Record]
    """By stage; those of another schema than this version's are left out."""
    artifacts: Mapping[str, str]
    """Digest of each artifact by its path below the scan's folder."""


def rows_of_results(results: Path) -> list[str]:
    """Names of the rows that have a folder with records or a verdict, sorted."""
    scans = (ScanFolder(results, path.name) for path in results.iterdir() if path.name not in RESERVED_IDS)
    return sorted(s.scan_id for s in scans if s.records.is_dir() or s.qa.is_file())


def state_of_folder(scan: ScanFolder) -> RowState:
    """State of a scan's folder, artifacts by the digests that their bytes have now.

    Of a row without any record, whatever has an artifact's name counts.
    """
    told = dict(raw_records(scan))
    names = sorted(_made(told)) if told else _known(scan)
    there = ((name, scan.path / name) for name in names)
    artifacts = {name: digest_of_path(path) for name, path in there if path.exists()}
    return RowState(read_json(scan.qa) if scan.qa.is_file() else None, _records(told), artifacts)


def recorded_state(qa: Mapping[str, Any] | None, told: Mapping[str, Mapping[str, Any]]) -> RowState:
    """State as records tell it (their contents by stage): the artifacts that they say were made."""
    return RowState(qa, _records(told), _made(told))


def raw_records(scan: ScanFolder) -> Iterator[tuple[str, dict[str, Any]]]:
    """Content of each record of a scan by stage, of whatever schema, in the order of their names."""
    for path in sorted(scan.records.glob("*.json")):
        if path.name.endswith(SUFFIX):
            continue
        try:
            raw = read_json(path)
        except ValueError:  # damaged; the audit says so
            continue
        if isinstance(raw, dict) and isinstance(raw.get("recipe"), dict):
            yield path.stem, raw


def _records(told: Mapping[str, Mapping[str, Any]]) -> dict[str, Record]:
    """Those of this schema: others cannot be compared recipe by recipe."""
    records = {stage: _record(raw) for stage, raw in told.items()}
    return {stage: record for stage, record in records.items() if record is not None}


def _record(raw: Mapping[str, Any]) -> Record | None:
    if raw.get("schema") != SCHEMA:
        return None
    try:
        own = {f.name: raw[f.name] for f in fields(Record) if f.name != "recipe"}
        return Record(recipe=Recipe(**raw["recipe"]), **own)
    except (KeyError, TypeError):
        return None


def _made(told: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    made = (raw.get("outputs") or {} for raw in told.values() if raw.get("outcome") == MADE)
    return {name: digest for outputs in made for name, digest in outputs.items()}


def _known(scan: ScanFolder) -> list[str]:
    paths = (
        *(scan.frames, scan.timeline, scan.capture_review, scan.snakes, scan.phase, scan.calibration),
        *(scan.cloud, scan.cloud_ply, scan.result_review, scan.qa, scan.report, scan.figures),
    )
    return sorted(str(path.relative_to(scan.path)) for path in paths)
