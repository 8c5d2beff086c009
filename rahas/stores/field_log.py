"""The field log: one row per capture, checked whole before anything runs.

Every fault is found in one reading and told with file, row, column, what was read and what is expected.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from rahas.errors import ExpeditionError
from rahas.stores.captures import CAPTURES, SIMULATED, Listing, PathRefused, path_below_captures
from rahas.stores.csv_table import Row, Table, TableUnreadable, read_table, shown

FIELD_LOG = "field_log.csv"
NEEDED_COLUMNS = ("scan_id", "site", "notes", "decision")
NOTEBOOK_COLUMNS = ("subject", "date", "time", "operator")
OPTIONAL_COLUMNS = ("role", "calibration", "capture", "texture", "redundant_of", *NOTEBOOK_COLUMNS)
RESERVED_IDS = frozenset({"history", "index", "expedition"})
DECISIONS = ("", "keep", "reject")
ROLES = ("scan", "calibration")

_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
_ID_EXPECTED = "1 to 64 letters, digits, '_' or '-' without accents, starting with a letter or a digit"


@dataclass(frozen=True)
class Entry:
    """One trusted row of the field log."""

    scan_id: str
    site: str
    notes: str
    decision: str
    """``keep``, ``reject`` or empty: the operator's own verdict."""
    role: str
    """``scan`` or ``calibration``."""
    calibration: str | None
    """scan_id of the calibration to use, resolved; None for a calibration and where the log has none to offer."""
    capture: Path | None
    """Where the capture is expected, there or not; None if the cell is empty and no capture has the id as its stem."""
    texture: Path | None
    """Where the texture photo is expected, likewise."""
    texture_named: bool
    """The log itself names the texture, so that its absence is a finding."""
    subject: str
    date: str
    time: str
    operator: str
    redundant_of: str | None
    extra: dict[str, str]
    """Cells of unknown columns, as typed."""
    line: int
    """Line of field_log.csv, from 1."""
    simulated: bool
    """The capture lies under simulated/: the workflow renders it."""


@dataclass(frozen=True)
class FieldLog:
    """The rows in the order of the log, and the faults for which rows were left out."""

    entries: tuple[Entry, ...]
    skipped: tuple[str, ...] = ()


@dataclass
class _Draft:
    """A row being checked: cleaned cells, its place in the log, and what is wrong with it."""

    row: Row
    place: int
    cells: dict[str, str]
    faults: list[str] = field(default_factory=list)

    def blame(self, column: str, expected: str) -> None:
        read = shown(self.row.cells.get(column, "").strip())
        self.faults.append(f"{FIELD_LOG}, row {self.row.line}, column {column}: read {read}, expected {expected}")


def read_field_log(expedition: Path, *, skip_bad_rows: bool = False) -> FieldLog:
    """Read and check ``field_log.csv`` of an expedition.

    With ``skip_bad_rows`` wrong rows are left out and their faults listed in ``skipped``. Of rows with the same id the
    first one counts. A row that names a left-out row stays, without that calibration or redundancy.

    Raises
    ------
    ExpeditionError
        All that is wrong with the log, a line a fault.
    """
    table = _table(expedition / FIELD_LOG)
    drafts = [_Draft(row, place, _cleaned(row)) for place, row in enumerate(table.rows)]
    listing = Listing()
    for draft in drafts:
        _check_cells(draft, expedition, table.delimiter, listing)
    _check_unique(drafts)
    _check_references(drafts)
    faults = [fault for draft in drafts for fault in draft.faults]
    if faults and not skip_bad_rows:
        raise ExpeditionError("\n".join(faults))
    good = [draft for draft in drafts if not draft.faults]
    unknown = [name for name in table.columns if name not in (*NEEDED_COLUMNS, *OPTIONAL_COLUMNS)]
    rows = _Rows(good)
    return FieldLog(tuple(_entry(draft, rows, expedition, unknown, listing) for draft in good), tuple(faults))


def _table(path: Path) -> Table:
    known = (*NEEDED_COLUMNS, *OPTIONAL_COLUMNS)
    try:
        return read_table(path, known_columns=known, needed_columns=NEEDED_COLUMNS)
    except TableUnreadable as error:
        raise ExpeditionError(str(error)) from None


def _cleaned(row: Row) -> dict[str, str]:
    cells = {name: row.cells.get(name, "").strip() for name in (*NEEDED_COLUMNS, *OPTIONAL_COLUMNS)}
    return cells | {
        "notes": row.cells.get("notes", ""),
        "decision": cells["decision"].lower(),
        "role": cells["role"].lower() or "scan",
    }


def _check_cells(draft: _Draft, expedition: Path, delimiter: str, listing: Listing) -> None:
    cells = draft.cells
    if not _ID.fullmatch(cells["scan_id"]):
        draft.blame("scan_id", _ID_EXPECTED)
    elif cells["scan_id"].lower() in RESERVED_IDS:
        draft.blame("scan_id", f"another id: {', '.join(sorted(RESERVED_IDS))} are names of the results folder")
    if not cells["site"]:
        draft.blame("site", "the name of the place")
    if cells["decision"] not in DECISIONS:
        draft.blame("decision", "keep, reject or nothing")
    if cells["role"] not in ROLES:
        draft.blame("role", "scan, calibration or nothing")
    for column in ("capture", "texture"):
        if cells[column]:
            try:
                path_below_captures(cells[column])
            except PathRefused as error:
                draft.blame(column, str(error))
    if draft.row.overhang:
        draft.faults.append(
            f"{FIELD_LOG}, row {draft.row.line}, after the last column: read {shown(draft.row.overhang[0])}, expected "
            f"no further cell (a note with {shown(delimiter)} in it has to stand between quotes)"
        )
    if not cells["capture"] and not draft.faults:
        found = listing.captures_with_stem(expedition / CAPTURES, cells["scan_id"])
        if len(found) > 1:
            names = " and ".join(path.name for path in found)
            draft.blame("capture", f"the name of one of the captures that this id may mean: {names}")


def _check_unique(drafts: Iterable[_Draft]) -> None:
    first: dict[str, _Draft] = {}
    for draft in drafts:
        scan_id = draft.cells["scan_id"]
        if not _ID.fullmatch(scan_id):
            continue
        taken = first.setdefault(scan_id.lower(), draft)
        if taken is not draft:
            draft.blame(
                "scan_id", f"an id of its own: row {taken.row.line} has {shown(taken.cells['scan_id'])} already"
            )


def _check_references(drafts: list[_Draft]) -> None:
    rows: dict[str, _Draft] = {}
    for draft in drafts:
        rows.setdefault(draft.cells["scan_id"], draft)
    for draft in drafts:
        for column, kinds in (("calibration", ("calibration",)), ("redundant_of", ROLES)):
            named = draft.cells[column]
            if not named:
                continue
            if named not in rows:
                draft.blame(column, f"the scan_id of another row{_nearest_name(named, rows)}")
            elif named == draft.cells["scan_id"]:
                draft.blame(column, "the scan_id of another row, not of this one (a cycle)")
            elif column == "calibration" and (cycle := _cycle_from(draft, rows)):
                draft.blame(column, f"no cycle: {' → '.join(cycle)}")
            elif (role := rows[named].cells["role"]) in ROLES and role not in kinds:
                draft.blame(column, f"a row whose role is calibration: row {rows[named].row.line} is a {role}")


def _nearest_name(named: str, rows: Iterable[str]) -> str:
    by_lower = {scan_id.lower(): scan_id for scan_id in rows}
    close = difflib.get_close_matches(named.lower(), list(by_lower), n=1)
    return f" (is it {shown(by_lower[close[0]])}?)" if close else ""


def _cycle_from(draft: _Draft, rows: dict[str, _Draft]) -> list[str]:
    """The ids from ``draft`` along the column calibration back to itself; empty if it does not come back."""
    start = draft.cells["scan_id"]
    chain = [start]
    named = draft.cells["calibration"]
    while named in rows and named not in chain:
        chain.append(named)
        named = rows[named].cells["calibration"]
    return [*chain, start] if named == start else []


class _Rows:
    """The rows that stay: all ids, and the calibrations by site, gathered once for all rows that ask."""

    def __init__(self, good: list[_Draft]) -> None:
        self.ids = {draft.cells["scan_id"] for draft in good}
        calibrations = [draft for draft in good if draft.cells["role"] == "calibration"]
        self.calibrations = [draft.cells["scan_id"] for draft in calibrations]
        self.calibration_ids = frozenset(self.calibrations)
        self.of_site: dict[str, list[_Draft]] = {}
        for draft in calibrations:
            self.of_site.setdefault(_site(draft), []).append(draft)


def _entry(draft: _Draft, rows: _Rows, expedition: Path, unknown: list[str], listing: Listing) -> Entry:
    cells = draft.cells
    capture = _below(expedition, cells["capture"])
    simulated = bool(cells["capture"]) and path_below_captures(cells["capture"]).parts[0] == SIMULATED
    if capture is None:
        capture = next(iter(listing.captures_with_stem(expedition / CAPTURES, cells["scan_id"])), None)
    texture = _below(expedition, cells["texture"])
    if texture is None:
        texture = listing.texture_with_stem(expedition / CAPTURES, cells["scan_id"])
    if texture is None and capture is not None and not simulated:
        texture = listing.texture_with_stem(capture.parent, cells["scan_id"])
    return Entry(
        **{name: cells[name] for name in (*NEEDED_COLUMNS, *NOTEBOOK_COLUMNS, "role")},
        calibration=_calibration_of(draft, rows),
        capture=capture,
        texture=texture,
        texture_named=bool(cells["texture"]),
        redundant_of=cells["redundant_of"] if cells["redundant_of"] in rows.ids else None,
        extra={name: draft.row.cells[name] for name in unknown},
        line=draft.row.line,
        simulated=simulated,
    )


def _below(expedition: Path, cell: str) -> Path | None:
    return expedition / CAPTURES / PurePosixPath(path_below_captures(cell)) if cell else None


def _calibration_of(draft: _Draft, rows: _Rows) -> str | None:
    """The named calibration; else the only one; else the nearest with the same site, the later one of two as near.

    One that the operator rejected is taken only where the site has no other.
    """
    if draft.cells["role"] == "calibration":
        return None
    if draft.cells["calibration"]:
        return draft.cells["calibration"] if draft.cells["calibration"] in rows.calibration_ids else None
    if len(rows.calibrations) == 1:
        return rows.calibrations[0]
    nearest = min(
        rows.of_site.get(_site(draft), []),
        key=lambda other: (
            other.cells["decision"] == "reject",
            abs(other.place - draft.place),
            draft.place > other.place,
        ),
        default=None,
    )
    return nearest.cells["scan_id"] if nearest else None


def _site(draft: _Draft) -> str:
    return " ".join(draft.cells["site"].split()).casefold()
