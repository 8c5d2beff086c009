"""What changed from one side to another, and by how much: the numbers behind table, JSON and page."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from rahas.errors import ExpeditionError
from rahas.kernels.change import depth_change, phase_change
from rahas.provenance.code import known_definitions
from rahas.provenance.differences import CHANGED, RowDifference, difference
from rahas.report.comparison_table import comparison_text
from rahas.stores.arrays import StoreIncomplete, open_store
from rahas.stores.atomic import write_text
from rahas.stores.layout import ScanFolder
from rahas.tasks.sides import Side, side_of

MAPS = 24  # on a page: those that changed most


def run(before: str, after: str, *, expedition: Path, page: Path | None = None, as_json: bool = False) -> int:
    """Print the comparison of two sides, and write it to ``page``; 0 if nothing differs, 1 if something does.

    Raises
    ------
    ExpeditionError
        A side cannot be read, or the page cannot be written.
    """
    try:
        sides = side_of(before, expedition), side_of(after, expedition)
        found = compared(*sides)
        if page is not None:
            from rahas.report.comparison import render_comparison

            write_text(page, render_comparison(found, _maps(sides, found)))
    except OSError as error:
        raise ExpeditionError(f"{error}; expected folders that can be read and a page that can be written") from None
    print(json.dumps(found, indent=1, ensure_ascii=False) if as_json else comparison_text(found))
    return int(found["differs"])


def compared(before: Side, after: Side) -> dict[str, Any]:
    """The comparison of two sides as plain values, as ``--json`` prints it."""
    scans = [_scan(before, after, scan_id) for scan_id in sorted(before.rows | after.rows)]
    return {
        "before": _told(before),
        "after": _told(after),
        "differs": any(scan["differs"] for scan in scans),
        "why": _grouped(scans),
        "scans": scans,
    }


def _scan(before: Side, after: Side, scan_id: str) -> dict[str, Any]:
    sides = before, after
    there = [scan_id in side.rows for side in sides]
    if not all(there):
        return {**_EMPTY, "scan_id": scan_id, "differs": True, "only": "before" if there[0] else "after"}
    code = partial(known_definitions, before.expedition_results), partial(known_definitions, after.expedition_results)
    found = difference(before.state(scan_id), after.state(scan_id), code=code)
    told = {**_EMPTY, "scan_id": scan_id, "differs": not found.is_empty, **_words(found)}
    if CHANGED in found.artifacts.values() and not found.causes:
        told["notes"] = [_UNCAUSED if found.stages else _UNTOLD]
    if before.results is not None and after.results is not None:
        folders = ScanFolder(before.results, scan_id), ScanFolder(after.results, scan_id)
        for name, measure in (("depth", _depth), ("phase", _phase)):
            try:
                told[name] = measure(*folders) if _is_to_be_measured(folders, name, found) else None
            except (StoreIncomplete, ValueError, KeyError, OSError) as error:
                told["notes"] = [*told["notes"], f"{name} cannot be compared: {error}"]
    return told


_EMPTY: Mapping[str, Any] = {
    "only": None, "verdict": ["", ""], "reasons": [[], []], "metrics": {}, "artifacts": {}, "causes": [],
    "depth": None, "phase": None, "notes": [],
}  # fmt: skip
_UNCAUSED = "no recipe changed: bytes were edited after they were made, or a stage does not repeat itself"
_UNTOLD = "why is not known: no records of this version on both sides"
_STORES = {"depth": "cloud.zarr", "phase": "phase.zarr"}


def _words(found: RowDifference) -> dict[str, Any]:
    return {
        "verdict": list(found.verdict),
        "reasons": [list(reasons) for reasons in found.reasons],
        "metrics": {name: list(values) for name, values in found.metrics.items()},
        "artifacts": found.artifacts,
        "causes": [
            {"stage": c.stage, "kind": c.change.kind, "name": c.change.name, "text": c.change.text}
            for c in found.causes
        ],
    }


def _is_to_be_measured(folders: tuple[ScanFolder, ScanFolder], name: str, found: RowDifference) -> bool:
    store = _STORES[name]
    return found.artifacts.get(store) == CHANGED and all((scan.path / store).is_dir() for scan in folders)


def _depth(before: ScanFolder, after: ScanFolder) -> dict[str, Any]:
    change = depth_change(**_depth_arrays(before, after))
    numbers = {name: _finite(value) for name, value in change._asdict().items() if name != "difference_mm"}
    return {**numbers, "pixels": int(change.difference_mm.size)}


def _depth_arrays(before: ScanFolder, after: ScanFolder) -> dict[str, Any]:
    was, now = open_store(before.cloud), open_store(after.cloud)
    return {
        "before_mm": was["xyz"][..., 2],
        "after_mm": now["xyz"][..., 2],
        "before_std_mm": was["z_std"][...],
        "after_std_mm": now["z_std"][...],
    }


def _phase(before: ScanFolder, after: ScanFolder) -> dict[str, Any]:
    was, now = (open_store(scan.phase)["unwrapped_phase"][...] for scan in (before, after))
    return {name: _finite(value) for name, value in phase_change(before_rad=was, after_rad=now)._asdict().items()}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _told(side: Side) -> dict[str, Any]:
    return {"name": side.name, "has_data": side.results is not None, "rows": len(side.rows), "made": dict(side.made)}


def _grouped(scans: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Causes by stage and words, each with the rows that it holds for."""
    groups: dict[tuple[str, str], list[str]] = {}
    for scan in scans:
        for cause in scan["causes"]:
            groups.setdefault((cause["stage"], cause["text"]), []).append(scan["scan_id"])
    return [{"stage": stage, "text": text, "scans": rows} for (stage, text), rows in groups.items()]


def _maps(sides: tuple[Side, Side], found: Mapping[str, Any]) -> dict[str, Any]:
    """Depth differences (y, x) in mm of the rows that changed most, read once more: all of them would not fit."""
    measured = [scan for scan in found["scans"] if scan["depth"] is not None and scan["depth"]["compared"]]
    measured.sort(key=lambda scan: -scan["depth"]["rms_mm"])
    maps = {}
    for scan in measured[:MAPS]:
        folders = [ScanFolder(side.results, scan["scan_id"]) for side in sides if side.results is not None]
        maps[scan["scan_id"]] = depth_change(**_depth_arrays(*folders)).difference_mm
    return maps
