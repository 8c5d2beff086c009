"""The expedition at a glance: results/index.html, results/scans.csv, the closing lines of a run; and its history."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from rahas.provenance.code import keep_definitions
from rahas.provenance.companions import Clock, write_companion
from rahas.provenance.fingerprints import package_code
from rahas.provenance.history import keep_run
from rahas.provenance.records import MADE, Record
from rahas.report.closing import closing_lines
from rahas.report.gallery import THUMBNAIL
from rahas.report.pages import Card, render_index
from rahas.report.table import scans_csv
from rahas.stores.atomic import read_json_or_none, sweep_dead, write_text
from rahas.stores.captures import CAPTURES, SIMULATED
from rahas.stores.digests import digest_of_bytes
from rahas.stores.field_log import Entry
from rahas.stores.layout import ScanFolder
from rahas.tasks.plan import SUMMARY_ENTRY
from rahas.tasks.recipes import summary_recipe

# Below results/, written by more than one job: what killed ones left there is swept by the last job of a run.
_SHARED = ("expedition/provenance", "expedition/provenance/code", "history")
_COLUMNS = ("scan_id", "site", "subject", "date", "time", "decision", "role", "redundant_of")


def run(results: Path, entries: Sequence[Entry], *, unfinished: Collection[str] = ()) -> str:
    """Write the index and the table of all rows of the log, keep the run; return the lines that close it.

    ``unfinished`` are the rows whose jobs have not all ended: their former verdicts do not count.
    """
    for folder in (results, *(results / name for name in _SHARED), results.parent / CAPTURES / SIMULATED):
        sweep_dead(folder)
    clock = Clock()
    cards = cards_of(results, entries, unfinished=unfinished)
    made = {"index.html": render_index(cards), "scans.csv": scans_csv(cards)}
    for name, text in made.items():
        write_text(results / name, text)
    digests = {name: digest_of_bytes(text.encode()) for name, text in made.items()}
    record, path = Record(summary_recipe(cards), MADE, digests), results / "expedition" / "provenance" / "summary.json"
    record.write(path)
    write_companion(path, record, clock)
    keep_definitions(results, package_code(), SUMMARY_ENTRY)
    keep_run(results, [entry.scan_id for entry in entries], unfinished=unfinished)
    return closing_lines(cards)


def cards_of(results: Path, entries: Sequence[Entry], *, unfinished: Collection[str] = ()) -> list[Card]:
    """What the index shows of each row."""
    return [_card(ScanFolder(results, e.scan_id), e, finished=e.scan_id not in unfinished) for e in entries]


def _card(scan: ScanFolder, entry: Entry, *, finished: bool) -> Card:
    return Card(
        row={name: getattr(entry, name) for name in _COLUMNS},
        qa=_verdict(scan) if finished else None,
        thumbnail=f"{scan.scan_id}/figures/{THUMBNAIL}" if (scan.figures / THUMBNAIL).is_file() else None,
        link=f"{scan.scan_id}/report.html" if scan.report.is_file() else None,
    )


def _verdict(scan: ScanFolder) -> Any:
    return read_json_or_none(scan.qa) if scan.qa.is_file() else None
