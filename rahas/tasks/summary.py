"""The expedition at a glance: results/index.html, results/scans.csv and the closing lines of a run."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from rahas.provenance.fingerprints import package_code
from rahas.provenance.records import MADE, Recipe, Record, library_versions
from rahas.report.closing import closing_lines
from rahas.report.gallery import THUMBNAIL
from rahas.report.pages import Card, render_index
from rahas.report.table import scans_csv
from rahas.stores.atomic import read_json, write_text
from rahas.stores.digests import digest_of_bytes, digest_of_json
from rahas.stores.field_log import Entry
from rahas.stores.layout import ScanFolder

_COLUMNS = ("scan_id", "site", "subject", "date", "time", "decision", "role", "redundant_of")


def run(results: Path, entries: Sequence[Entry], *, unfinished: Collection[str] = ()) -> str:
    """Write the index and the table of all rows of the log; return the lines that close a run.

    ``unfinished`` are the rows whose jobs have not all ended: their former verdicts do not count.
    """
    cards = [_card(ScanFolder(results, e.scan_id), e, finished=e.scan_id not in unfinished) for e in entries]
    made = {"index.html": render_index(cards), "scans.csv": scans_csv(cards)}
    for name, text in made.items():
        write_text(results / name, text)
    recipe = Recipe(
        stage="summary",
        inputs={card.row["scan_id"]: digest_of_json([card.qa, card.thumbnail, card.link]) for card in cards},
        columns={card.row["scan_id"]: dict(card.row) for card in cards},
        params={},
        code=package_code().fingerprint("rahas.tasks.summary:run"),
        libraries=library_versions("jinja2"),
    )
    digests = {name: digest_of_bytes(text.encode()) for name, text in made.items()}
    Record(recipe, MADE, digests).write(results / "expedition" / "provenance" / "summary.json")
    return closing_lines(cards)


def _card(scan: ScanFolder, entry: Entry, *, finished: bool) -> Card:
    return Card(
        row={name: getattr(entry, name) for name in _COLUMNS},
        qa=_verdict(scan) if finished else None,
        thumbnail=f"{scan.scan_id}/figures/{THUMBNAIL}" if (scan.figures / THUMBNAIL).is_file() else None,
        link=f"{scan.scan_id}/report.html" if scan.report.is_file() else None,
    )


def _verdict(scan: ScanFolder) -> Any:
    return read_json(scan.qa) if scan.qa.is_file() else None
