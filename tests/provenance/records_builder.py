"""Results folders with records as the workflow writes them, small and made up."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rahas.provenance.records import MADE, Recipe, Record
from rahas.stores.atomic import write_json
from rahas.stores.digests import digest_of_json, digest_of_path
from rahas.stores.layout import ScanFolder

STAGES = {"timeline": (), "phase": ("timeline",), "cloud": ("phase",)}


def write_records(scan: ScanFolder, params: Mapping[str, Any] | None = None, **outputs: tuple[Path, ...]) -> None:
    """A record a stage; ``outputs`` are artifacts that lie there, ``params`` those of the stage phase."""
    for stage, needs in STAGES.items():
        made = {str(p.relative_to(scan.path)): digest_of_path(p) for p in outputs.get(stage, ())}
        recipe = Recipe(
            stage=stage,
            inputs={need: digest_of_json([need, params if stage == "cloud" else None]) for need in needs},
            columns={"role": "scan"},
            params=dict(params or {}) if stage == "phase" else {},
            code=digest_of_json(stage),
            libraries={"numpy": "2.0"},
        )
        Record(recipe, MADE, made or {f"{stage}.json": digest_of_json([stage, params])}).write(
            scan.records / f"{stage}.json"
        )


def write_row(
    results: Path, scan_id: str, *, verdict: str = "accepted", metrics: Mapping[str, Any] | None = None, **params: Any
) -> ScanFolder:
    """A row with records and a verdict."""
    scan = ScanFolder(results, scan_id)
    qa = {"scan_id": scan_id, "verdict": verdict, "reasons": [], "warnings": [], "metrics": dict(metrics or {})}
    write_json(scan.qa, qa)
    write_records(scan, params)
    return scan
