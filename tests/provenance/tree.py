"""A small expedition as jobs leave it: the real records, pages and stamps over synthetic artifacts."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from rahas.stores.atomic import write_json
from rahas.stores.digests import manifest_of_folder
from rahas.stores.layout import ScanFolder
from rahas.tasks import job, render, simulate, summary
from rahas.tasks.audit import Audit, audit_of
from rahas.tasks.expedition import Expedition, open_expedition
from rahas.tasks.pipeline import STAGES
from rahas.tasks.plan import Plan, write_stamp
from tests.report import expedition_builder as build
from tests.workflow.expedition import row, write_log, write_target

SHAPE = (24, 32)
ROWS = (
    row("cal", role="calibration", decision="keep"),
    row("rock", decision="keep", notes='circle, "under" the ledge', operator="EC"),
    row("rock2", redundant_of="rock"),
    row("far", notes="too far away"),
    row("late", notes="rejected for its cloud"),
    row("lost", capture="lost.mkv"),
    row("wet", decision="reject"),
    row("made", capture="simulated/made.mkv"),
)
SIMULATION = """
setups:
  bench: {}
captures:
  made: {setup: bench, scene: {kind: circle}}
"""


@dataclass(frozen=True)
class Tree:
    """The folder of a processed expedition."""

    root: Path

    @property
    def results(self) -> Path:
        return self.root / "results"

    def open(self) -> Expedition:
        return open_expedition(self.root)

    def audit(self, *asked: str, **options: Any) -> Audit:
        return audit_of(self.open(), asked, **options)

    def log(self, *rows: dict[str, str]) -> None:
        write_log(self.root, rows)

    def configure(self, text: str) -> None:
        (self.root / "config" / "config.yaml").write_text(text, encoding="utf-8")

    def copy(self, root: Path) -> Tree:
        """A copy with new modification times."""
        return Tree(Path(shutil.copytree(self.root, root, copy_function=shutil.copy)))

    def files(self) -> list[Path]:
        """Every file below results/, sorted."""
        return sorted(path for path in self.results.rglob("*") if path.is_file())


def bring_home(root: Path) -> None:
    """Log, target and captures, nothing processed."""
    (root / "captures").mkdir(parents=True)
    for name in ("cal.mkv", "rock.mkv", "rock2.mkv", "far.mkv", "late.mkv", "wet.mkv", "rock_texture.png"):
        (root / "captures" / name).write_bytes(f"what {name} holds".encode() * 40)
    write_target(root / "config" / "target.csv")
    (root / "config" / "simulation.yaml").write_text(SIMULATION, encoding="utf-8")
    write_log(root, ROWS)


def process(
    root: Path, patch: pytest.MonkeyPatch, options: Mapping[str, str] | None = None, *, only: tuple[str, ...] = ()
) -> None:
    """Run every job that is due, calibrations first; stages write synthetic artifacts in place of measuring.

    ``options`` are the keys of ``--config``; with ``only``, just these rows are brought up to date, and no index.
    """
    for stage in STAGES.values():
        module, _, function = stage.entry.partition(":")
        patch.setattr(import_module(module), function, _STAND_INS[stage.name])
    patch.setattr(simulate, "run", _rendered)
    expedition = open_expedition(root, options)
    for entry in sorted(expedition.entries, key=lambda entry: entry.role):
        if only and entry.scan_id not in only:
            continue
        if entry.simulated and not (root / Plan(expedition).render_stamp(entry)).exists():
            render.run(root, entry.scan_id)
            write_stamp(root / Plan(expedition).render_stamp(entry), {"rendered": entry.scan_id})
        expedition = open_expedition(root, options)
        for one in Plan(expedition).jobs(expedition.entry(entry.scan_id)):
            stamp = root / Plan(expedition).stamp(one.name, entry.scan_id)
            if not stamp.exists():
                job.run(expedition, one.name, entry.scan_id, stamp)
    if only:
        return
    plan = Plan(expedition)
    summary.run(expedition.results, expedition.entries, unfinished=plan.unfinished())
    write_stamp(root / plan.summary_stamp(), {"rows": len(expedition.entries)})


def _frames(scan: ScanFolder, *, capture: Path, params: Any) -> None:
    before = ScanFolder(scan.path / "aside", scan.scan_id)
    build.write_capture(before, shape=SHAPE)
    _with_mark(before.frames, capture.read_bytes())
    shutil.rmtree(scan.frames, ignore_errors=True)
    shutil.move(before.frames, scan.frames)
    shutil.rmtree(scan.path / "aside")


def _with_mark(store: Path, content: bytes) -> None:
    """Let the store differ from that of another capture: an attribute of its own, listed in its manifest."""
    group = json.loads((store / "zarr.json").read_text(encoding="utf-8"))
    group["attributes"]["capture"] = content[:16].decode()
    (store / "zarr.json").write_text(json.dumps(group), encoding="utf-8")
    manifest = json.dumps({"files": manifest_of_folder(store)}, indent=0, sort_keys=True)
    (store / "manifest.json").write_text(manifest, encoding="utf-8")


def _timeline(scan: ScanFolder, *, params: Any) -> None:
    write_json(scan.timeline, build.timeline(scan.scan_id))


def _capture_review(scan: ScanFolder, *, role: str, params: Any) -> None:
    reasons = [build.reason("object_span")] if scan.scan_id == "far" else []
    write_json(scan.capture_review, {"metrics": {"object_span": 0.9}, "reasons": reasons, "warnings": []})


def _snakes(scan: ScanFolder, *, params: Any) -> None:
    build.write_snakes(scan, shape=SHAPE)


def _phase(scan: ScanFolder, *, calibration: ScanFolder | None, params: Any) -> None:
    build.write_phase(scan, shape=SHAPE)


def _calibration(scan: ScanFolder, *, target: Path, texture: Path | None, params: Any) -> None:
    shot = json.loads((scan.frames / "zarr.json").read_text(encoding="utf-8"))["attributes"]["capture"]
    write_json(scan.calibration, build.calibration() | {"shot": shot})


def _cloud(scan: ScanFolder, *, calibration: ScanFolder, texture: Path | None, params: Any) -> None:
    build.write_cloud(scan, shape=SHAPE)
    scan.cloud_ply.write_bytes(b"ply\n" + bytes(range(256)) + scan.scan_id.encode())


def _result_review(scan: ScanFolder, *, role: str, params: Any, capture_params: Any) -> None:
    reasons = [build.reason("measured_share")] if scan.scan_id == "late" else []
    write_json(scan.result_review, {"metrics": {"measured_share": 0.8}, "reasons": reasons, "warnings": []})


def _rendered(*, spec_path: Path, scan_id: str, captures: Path) -> None:
    folder = captures / "simulated"
    folder.mkdir(parents=True, exist_ok=True)
    for name in (f"{scan_id}.mkv", f"{scan_id}_texture.png", f"{scan_id}_truth.npz"):
        (folder / name).write_bytes(f"rendered {name} {spec_path.read_text()}".encode())


_STAND_INS: dict[str, Callable[..., None]] = {
    "ingest": _frames,
    "timeline": _timeline,
    "review_capture": _capture_review,
    "snakes": _snakes,
    "phase": _phase,
    "calibrate": _calibration,
    "cloud": _cloud,
    "review_result": _result_review,
}
