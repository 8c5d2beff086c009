"""A scan's page: whatever artifacts there are, shown; nothing is computed that another stage would need."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2

from rahas.report.compose import ARTIFACTS, compose
from rahas.report.figures import Figure
from rahas.report.gallery import Evidence
from rahas.report.pages import render_scan
from rahas.stores.arrays import StoreIncomplete, open_store
from rahas.stores.atomic import read_json, replacing, write_text
from rahas.stores.field_log import Entry
from rahas.stores.layout import ScanFolder

_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 85]
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 3]
_COLUMNS = ("scan_id", "site", "subject", "date", "time", "operator", "notes", "decision", "role", "redundant_of")


def run(scan: ScanFolder, *, entry: Entry, calibration: ScanFolder | None) -> None:
    """Write ``figures/`` and ``report.html`` of a scan from the artifacts that exist; ``qa.json`` has to."""
    evidence = Evidence(
        frames=_store(scan.frames),
        timeline=_json(scan.timeline),
        snakes=_store(scan.snakes),
        phase=_store(scan.phase),
        calibration=_json(scan.calibration),
        cloud=_store(scan.cloud),
    )
    row = {name: getattr(entry, name) for name in (*_COLUMNS, "simulated", "extra")}
    composed = compose(
        evidence,
        row=row | {"calibration": calibration.scan_id if calibration else None},
        qa=read_json(scan.qa),
        review=_json(scan.capture_review),
        present=_present(scan),
    )
    _write_figures(scan.figures, composed.figures)
    write_text(scan.report, render_scan(composed.page))


def _write_figures(folder: Path, figures: Sequence[Figure]) -> None:
    with replacing(folder) as temporary:
        temporary.mkdir()
        for figure in figures:
            suffix = Path(figure.name).suffix
            encoded = cv2.imencode(suffix, figure.image, _JPEG if suffix == ".jpg" else _PNG)[1]
            (temporary / figure.name).write_bytes(encoded.tobytes())


def _present(scan: ScanFolder) -> set[str]:
    paths = [path for name, _, stage in ARTIFACTS for path in (name, f"provenance/{stage}.json")]
    return {path for path in paths if (scan.path / path).exists()}


def _store(path: Path) -> Any:
    try:
        return open_store(path) if path.is_dir() else None
    except StoreIncomplete:
        return None


def _json(path: Path) -> Any:
    return read_json(path) if path.is_file() else None
