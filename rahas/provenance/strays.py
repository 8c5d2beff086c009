"""Files below results/ that nothing accounts for, and small files beside the records that are damaged."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator
from pathlib import Path

from rahas.provenance import code, companions
from rahas.provenance.audit import Finding
from rahas.provenance.history import HISTORY, read_run
from rahas.provenance.integrity import stamp_fault
from rahas.provenance.lineage import Step, Steps
from rahas.stores.atomic import TEMPORARY_PREFIX, read_json

EXPEDITION = "expedition"
_OWN = frozenset({".gitkeep"})
STAMP = re.compile(r"((render|capture|phase|calibrate|surface|summary)\.[0-9a-f]{16}|summary\.unasked)\.[0-9]+")
_KEPT_RUN = re.compile(r"[0-9]{4,}\.(json\.gz|made\.json)")


def stray_findings(root: Path, steps: Steps, scans: Collection[str]) -> list[Finding]:
    """All strays below ``root``/results and what killed jobs left in captures/simulated.

    ``scans`` are the rows of the log.
    """
    results = root / "results"
    found = list(_left_in(root / "captures" / "simulated", root))
    accounted = _accounted(steps, EXPEDITION)
    for path in sorted(results.iterdir()) if results.is_dir() else []:
        if path.name in _OWN:
            continue
        if not path.is_dir():
            found += _unaccounted(path, path.name, root, accounted, EXPEDITION)
        elif path.name in (EXPEDITION, HISTORY, *scans):
            found += scan_strays(root, steps, path.name)
        elif path.name.startswith(TEMPORARY_PREFIX):
            found.append(_leftover(path, root, EXPEDITION))
        elif any(path.rglob("*")):
            text = "no row of the log has this scan_id: delete the folder, or put the row back"
            found.append(Finding("row", path.name, "", f"results/{path.name}", "", text))
    return found


def scan_strays(root: Path, steps: Steps, scan: str) -> list[Finding]:
    """The strays in one folder of results/."""
    folder = root / "results" / scan
    accounted = _accounted(steps, scan)
    found: list[Finding] = []
    for place, folders, files in os.walk(folder):
        here = Path(place)
        for name in sorted(folders):
            path = here / name
            if name.startswith(TEMPORARY_PREFIX):
                folders.remove(name)
                found.append(_leftover(path, root, scan))
            elif f"{path.relative_to(folder)}/" in accounted:
                folders.remove(name)
        folders.sort()
        for name in sorted(files):
            path = here / name
            found += _unaccounted(path, str(path.relative_to(folder)), root, accounted, scan)
    return found


def _accounted(steps: Steps, scan: str) -> set[str]:
    """Paths below results/<scan> that steps account for; stores, looked into elsewhere, end with a slash."""
    found: set[str] = set()
    for (owner, stage), step in steps.items():
        if owner == scan:
            found |= {f"provenance/{stage}.json", f"provenance/{stage}{companions.SUFFIX}"}
            found |= _artifacts(step)
    return found


def _artifacts(step: Step) -> set[str]:
    names = set(step.made.outputs) if step.made else set(step.outputs)
    return names | {f"{name}/" for name in step.outputs if name.endswith(".zarr") or not step.made}


def _unaccounted(path: Path, name: str, root: Path, accounted: set[str], scan: str) -> Iterator[Finding]:
    shown = str(path.relative_to(root))
    if name in accounted:
        if name.endswith(companions.SUFFIX) and not companions.is_sound(path):
            yield Finding("companion", scan, "", shown, "", "the companion is damaged: when and where is not known")
        return
    fault = _fault_of_small_file(path, name, scan)
    if fault is None:
        yield Finding("orphan", scan, "", shown, "", "nothing accounts for this file")
    elif fault:
        yield Finding("companion", scan, "", shown, "", fault)


def _fault_of_small_file(path: Path, name: str, scan: str) -> str | None:
    """Empty for a sound stamp or table of code, its fault for a damaged one, None for any other file."""
    folder, _, base = name.rpartition("/")
    if folder == "provenance" and STAMP.fullmatch(base):
        return stamp_fault(path) or ""
    if scan == EXPEDITION and folder == "provenance/code" and base.endswith(".json"):
        return "" if code.is_sound(path) else "the table of definitions is damaged: delete it"
    if scan == HISTORY and (match := _KEPT_RUN.fullmatch(name)):
        return _fault_of_history(path, is_run=match[1] == "json.gz")
    return None


def _fault_of_history(path: Path, *, is_run: bool) -> str:
    try:
        read_run(path) if is_run else read_json(path)
    except (OSError, ValueError) as error:
        return f"what is kept of a former run cannot be read: {error}"
    return ""


def _leftover(path: Path, root: Path, scan: str) -> Finding:
    text = "left by a job that was killed, or being written now; the scan's next job removes it"
    return Finding("leftover", scan, "", str(path.relative_to(root)), "", text)


def _left_in(folder: Path, root: Path) -> Iterator[Finding]:
    for path in sorted(folder.glob(f"{TEMPORARY_PREFIX}*")):
        yield _leftover(path, root, EXPEDITION)
