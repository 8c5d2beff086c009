"""Small synthetic artifacts of a scan, in the formats of docs/ARCHITECTURE.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rahas.stores.arrays import writing_store
from rahas.stores.atomic import write_json
from rahas.stores.field_log import Entry
from rahas.stores.layout import ScanFolder
from rahas.vocabulary import QUANTITIES

FRAMES = 60
INTERVALS = [
    {"stage": "dark", "first": 0, "last": 4},
    {"stage": "hold", "first": 5, "last": 12},
    {"stage": "rotation", "first": 13, "last": 32},
    {"stage": "hold", "first": 33, "last": 39},
    {"stage": "scan", "first": 40, "last": 54},
    {"stage": "hold", "first": 55, "last": 59},
]


def entry(scan_id: str = "rock1", **changes: Any) -> Entry:
    """A row of the field log."""
    cells: dict[str, Any] = {
        "scan_id": scan_id, "site": "Los Metates", "notes": "", "decision": "keep", "role": "scan",
        "calibration": "cal1", "capture": None, "texture": None, "texture_named": False, "subject": "metate",
        "date": "2009-07-14", "time": "21:40", "operator": "E. Crane", "redundant_of": None, "extra": {}, "line": 2,
        "simulated": False,
    }  # fmt: skip
    return Entry(**(cells | changes))


def verdict(scan_id: str = "rock1", outcome: str = "accepted", **changes: Any) -> dict[str, Any]:
    """A qa.json."""
    qa: dict[str, Any] = {
        "scan_id": scan_id, "verdict": outcome, "reasons": [], "warnings": [], "decision": "keep", "gate": "result",
        "metrics": {"object_span": 0.93, "jitter": 0.21, "periods": 1.62, "contrast": None},
    }  # fmt: skip
    return qa | changes


def reason(rule: str = "jitter", **changes: Any) -> dict[str, Any]:
    """One finding of a review."""
    finding = {
        "rule": rule, "metric": rule, "value": 3.41, "limit": 1.0, "unit": "px",
        "message": "The rig shook by 3.4 px in the worst second: let it settle after touching the lever.",
    }  # fmt: skip
    return finding | changes


def timeline(scan_id: str = "rock1") -> dict[str, Any]:
    """A timeline.json with a lever that moves evenly and a crank that does, too."""
    n = np.arange(FRAMES)
    angle = np.clip((n - 13) / 20.0, 0, 1) * 90.0
    step = np.clip((n - 40) / 15.0, 0, 1) * 10.2
    return {
        "scan_id": scan_id, "frames": FRAMES, "frame_rate": 30.0, "intervals": INTERVALS, "duplicates": [17],
        "dropped": [{"after": 20, "count": 2}], "rotation_sense": 1, "periods": 1.62,
        "slide_angle_deg": [None if k < 5 else round(float(a), 3) for k, a in enumerate(angle)],
        "phase_step_rad": [round(float(s), 4) if k >= 40 else None for k, s in enumerate(step)],
    }  # fmt: skip


def write_capture(scan: ScanFolder, *, shape: tuple[int, int] = (96, 128), field_order: str = "progressive") -> None:
    """frames.zarr and timeline.json: stripes that turn and then travel."""
    line = timeline(scan.scan_id)
    y, x = np.indices(shape, dtype=np.float64)
    stack = np.zeros((FRAMES, *shape), np.uint8)
    for k in range(5, FRAMES):
        angle, step = np.deg2rad(line["slide_angle_deg"][k]), line["phase_step_rad"][k] or 0.0
        wave = np.cos(0.35 * (x * np.cos(angle) + y * np.sin(angle)) + step)
        stack[k] = 90 + 70 * wave * (np.hypot(y / shape[0] - 0.5, x / shape[1] - 0.5) < 0.45)
    attributes = {"frame_rate": 30.0, "field_order": field_order, "interlaced": field_order != "progressive"}
    with writing_store(scan.frames, **attributes) as store:
        store.put("frames", ("frame", "y", "x"), stack, chunks=(8, *shape), **_units("frames"))
        store.put("time_s", ("frame",), np.arange(FRAMES) / 30.0, **_units("time_s"))
    write_json(scan.timeline, line)


def write_snakes(scan: ScanFolder, *, shape: tuple[int, int] = (96, 128), snakes: int = 5) -> None:
    """snakes.zarr: level lines, broken here and there."""
    identity = np.broadcast_to(np.arange(1, snakes + 1)[None, :, None], (FRAMES, snakes, shape[1])).astype(np.int16)
    identity[:, :, 40:47] = 0
    rows = np.linspace(10, shape[0] - 10, snakes)[None, :, None] + 3 * np.sin(np.arange(shape[1]) / 9.0)
    rows = np.where(identity > 0, rows, np.nan).astype(np.float32)
    turn = [0.0 if a is None else 90.0 - a for a in timeline()["slide_angle_deg"]]
    with writing_store(scan.snakes, stripes_seen=snakes, pitch_px=18.0) as store:
        store.put("snake_identity", ("frame", "snake", "x"), identity, **_units("snake_identity"))
        store.put("snake_y", ("frame", "snake", "x"), rows, **_units("snake_y"))
        store.put("unrotation_deg", ("frame",), np.float32(turn), **_units("unrotation_deg"))


def write_phase(scan: ScanFolder, *, shape: tuple[int, int] = (96, 128)) -> None:
    """phase.zarr: a tilted plane's phase, unmeasured in a corner."""
    y, x = np.indices(shape, dtype=np.float32)
    unwrapped = 0.35 * y + 0.4 * np.sin(x / 20)
    unwrapped[:20, :30] = np.nan
    wrapped = np.angle(np.exp(1j * unwrapped)).astype(np.float32)
    with writing_store(scan.phase, order_of_first_snake=0) as store:
        store.put("wrapped_phase", ("y", "x"), wrapped, **_units("wrapped_phase"))
        store.put("unwrapped_phase", ("y", "x"), unwrapped, **_units("unwrapped_phase"))
        for name, level in (("quality", 0.7), ("modulation", 60.0), ("background", 90.0)):
            values = np.where(np.isfinite(unwrapped), level + 0.1 * level * np.cos(x / 15), np.nan)
            store.put(name, ("y", "x"), values.astype(np.float32), **_units(name))


def write_cloud(scan: ScanFolder, *, shape: tuple[int, int] = (96, 128), lift_mm: float = 0.0) -> None:
    """cloud.zarr and a file in cloud.ply's place: a dome, unmeasured in a corner."""
    y, x = np.indices(shape, dtype=np.float32)
    centre_y, centre_x = shape[0] / 2, shape[1] / 2
    z = lift_mm + 20 * np.exp(-((x - centre_x) ** 2 + (y - centre_y) ** 2) / (2 * 25.0**2))
    xyz = np.stack([x - centre_x, centre_y - y, z], axis=2).astype(np.float32)
    xyz[:20, :30] = np.nan
    rgb = np.repeat(np.uint8(np.clip(100 + 4 * z, 0, 255))[..., None], 3, axis=2)
    with writing_store(scan.cloud) as store:
        store.put("xyz", ("y", "x", "axis"), xyz, **_units("xyz"))
        store.put("z_std", ("y", "x"), np.full(shape, 0.05, np.float32), **_units("z_std"))
        store.put("rgb", ("y", "x", "channel"), rgb, **_units("rgb"))
    scan.cloud_ply.write_bytes(b"ply\n")


def calibration() -> dict[str, Any]:
    """A calibration.json with 18 marks."""
    marks = [
        {"mark": 3 * c + r + 1, "x_px": 15.0 + 19 * c, "y_px": 15.0 + 30 * r, "unwrapped_phase": 7.0 * r,
         "residual_x_px": 0.1 * (c - 2.5), "residual_y_px": 0.08 * (r - 1)}
        for c in range(6) for r in range(3)
    ]  # fmt: skip
    camera = {"matrix": [[1.0, 0, 0, 64], [0, -1.0, 0, 48], [0, 0, 0, 1]], "width_px": 128, "height_px": 96,
              "radial": 0.0, "centre_px": [63.5, 47.5]}  # fmt: skip
    return {
        "camera": camera,
        "projector": {"matrix": [[0, 0.1, 0, 5], [0, 0, 0, 1]], "radial": 0.0, "centre_mm": [0, 9, 90]},
        "first_stop": {"matrix": [[0.1, 0, 0, 5], [0, 0, 0, 1]]}, "standard_deviations": {"camera_m1": 0.01},
        "texture_camera": None,
        "residuals": {"camera_rms_px": 0.12, "camera_max_px": 0.3}, "marks": marks, "covariance": None,
    }  # fmt: skip


def write_all(scan: ScanFolder, *, shape: tuple[int, int] = (96, 128), field_order: str = "progressive") -> None:
    """Every artifact of an accepted scan."""
    write_capture(scan, shape=shape, field_order=field_order)
    write_snakes(scan, shape=shape)
    write_phase(scan, shape=shape)
    write_cloud(scan, shape=shape)
    write_json(scan.qa, verdict(scan.scan_id))


def folder(results: Path, scan_id: str = "rock1") -> ScanFolder:
    return ScanFolder(results, scan_id)


def _units(name: str) -> dict[str, str]:
    quantity = next(q for q in QUANTITIES if q.name == name)
    return {"long_name": quantity.definition, "units": quantity.unit}
