"""phase.zarr of a scan of the target, the target's table and its photo → calibration.json."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rahas.params import CalibrationParams
from rahas.stages.calibrate import calibrate
from rahas.stages.first_hold import first_hold_of
from rahas.stages.rotation_frames import rotation_of_timeline
from rahas.stages.sighting import Target
from rahas.stores.arrays import open_store
from rahas.stores.atomic import read_json, write_json
from rahas.stores.layout import ScanFolder
from rahas.stores.photos import read_texture
from rahas.stores.target import read_target


def run(scan: ScanFolder, *, target: Path, texture: Path | None, params: CalibrationParams) -> None:
    """Calibrate camera, projector and, where there is a photo of the target, the texture camera."""
    phase = open_store(scan.phase)
    marks = read_target(target)
    table = Target(
        np.array([mark.mark for mark in marks]),
        np.array([(mark.x_mm, mark.y_mm, mark.z_mm) for mark in marks]),
        np.array([np.nan if mark.diameter_mm is None else mark.diameter_mm for mark in marks]),
    )
    photo = None if texture is None else read_texture(texture).mean(axis=2, dtype=np.float32)
    calibration = calibrate(
        background=phase["background"][...],
        unwrapped_phase=phase["unwrapped_phase"][...],
        target=table,
        photo=photo,
        params=params,
        modulation=phase["modulation"][...],
        hold=first_hold_of(open_store(scan.frames)["frames"], rotation_of_timeline(read_json(scan.timeline))),
    )
    write_json(scan.calibration, {"scan_id": scan.scan_id, **calibration.as_json()})
