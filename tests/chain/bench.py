"""Captures rendered into files and brought through the tasks in this process, in the order of the data."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2

from rahas.errors import CaptureProblem
from rahas.params import Config
from rahas.simulate.capture import photo, stage
from rahas.simulate.roof import DIAMETER_MM, target_marks
from rahas.simulate.specs import CaptureSpec
from rahas.stores.atomic import read_json
from rahas.stores.layout import ScanFolder
from rahas.stores.video_writer import SUFFIXES, write_frames
from rahas.tasks import calibrate, cloud, ingest, phase, review, snakes, timeline
from rahas.tasks.simulate import encoding_of
from rahas.typing import AnyArray

Truth = dict[str, AnyArray]


@dataclass(frozen=True)
class Processed:
    """What became of a capture."""

    scan: ScanFolder
    reasons: list[dict[str, Any]]
    """Why it was rejected; empty where it was not."""

    @property
    def verdict(self) -> str:
        """``accepted``, or the rules that rejected it."""
        return " ".join(sorted({reason["rule"] for reason in self.reasons})) or "accepted"

    @property
    def why(self) -> str:
        return "; ".join(f"{r['metric']} = {r['value']} (limit {r['limit']})" for r in self.reasons)


def film(captures: Path, scan_id: str, capture: CaptureSpec, *, with_photo: bool = False) -> tuple[Path, Truth]:
    """Render a capture into ``captures``: its file (or folder) and its truth."""
    staged = stage(capture)
    encoding = encoding_of(capture)
    path = captures / (scan_id + SUFFIXES[encoding.codec])
    write_frames(path, staged.frames(), encoding)
    if with_photo:
        cv2.imwrite(str(captures / f"{scan_id}_texture.png"), photo(staged)[..., ::-1])
    return path, staged.truth()


def write_target(path: Path) -> Path:
    """The renderer's roof target as a target.csv."""
    rows = [f"{n},{x:.4f},{y:.4f},{z:.4f},{DIAMETER_MM}" for n, (x, y, z) in enumerate(target_marks(), 1)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(["mark,x_mm,y_mm,z_mm,diameter_mm", *rows]) + "\n", encoding="utf-8")
    return path


def process(
    scan: ScanFolder,
    capture: Path,
    *,
    calibration: ScanFolder | None = None,
    target: Path | None = None,
    texture: Path | None = None,
    config: Config | None = None,
) -> Processed:
    """Every task of a row, up to the one that rejects it. A scan has a ``calibration``, a calibration a ``target``."""
    settings, role = config or Config(), "calibration" if calibration is None else "scan"
    try:
        ingest.run(scan, capture=capture, params=settings.ingest)
        timeline.run(scan, params=settings.timeline)
        review.run_capture(scan, role=role, params=settings.capture_review)
        if reasons := read_json(scan.capture_review)["reasons"]:
            return Processed(scan, reasons)
        snakes.run(scan, params=settings.snakes)
        phase.run(scan, calibration=calibration, params=settings.phase)
        if calibration is None:
            assert target is not None
            calibrate.run(scan, target=target, texture=texture, params=settings.calibration)
            return Processed(scan, [])
        cloud.run(scan, calibration=calibration, texture=texture, params=settings.cloud)
        review.run_result(scan, role=role, params=settings.result_review, capture_params=settings.capture_review)
    except CaptureProblem as problem:
        return Processed(scan, [problem.as_reason()])
    return Processed(scan, read_json(scan.result_review)["reasons"])
