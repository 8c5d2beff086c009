"""Render a capture, and leave its record: what a simulated capture's lineage begins with."""

from __future__ import annotations

from pathlib import Path

from rahas.provenance.code import keep_definitions
from rahas.provenance.companions import Clock, write_companion
from rahas.provenance.fingerprints import package_code
from rahas.provenance.records import MADE, MAKING, Record
from rahas.stores.atomic import sweep_dead
from rahas.stores.captures import CAPTURES, SIMULATED
from rahas.stores.digests import digests_of_files
from rahas.stores.layout import ScanFolder
from rahas.stores.video_writer import SUFFIXES
from rahas.tasks import simulate
from rahas.tasks.book import read_capture_spec
from rahas.tasks.plan import SIMULATE_ENTRY
from rahas.tasks.recipes import render_recipe


def run(root: Path, scan_id: str) -> None:
    """Render the capture ``scan_id`` of the expedition at ``root``; record it under results/<scan_id>/provenance.

    Raises
    ------
    ExpeditionError
        The simulation book does not hold it.
    """
    sweep_dead(root / CAPTURES / SIMULATED)
    clock = Clock()
    spec_path, record_path = root / "config" / "simulation.yaml", record_path_of(root, scan_id)
    recipe = render_recipe(spec_path, scan_id)
    Record(recipe, MAKING).write(record_path)
    simulate.run(spec_path=spec_path, scan_id=scan_id, captures=root / CAPTURES)
    record = Record(recipe, MADE, digests_of_files(root, rendered_files(root, spec_path, scan_id)))
    record.write(record_path)
    write_companion(record_path, record, clock)
    keep_definitions(root / "results", package_code(), SIMULATE_ENTRY)


def record_path_of(root: Path, scan_id: str) -> Path:
    """Where the record of a rendered capture lies."""
    return ScanFolder(root / "results", scan_id).records / "render.json"


def rendered_files(root: Path, spec_path: Path, scan_id: str) -> tuple[Path, Path, Path]:
    """Capture, texture photo and truth."""
    folder = root / CAPTURES / SIMULATED
    suffix = SUFFIXES[read_capture_spec(spec_path, scan_id).encoding.codec]
    return folder / f"{scan_id}{suffix}", folder / f"{scan_id}_texture.png", folder / f"{scan_id}_truth.npz"
