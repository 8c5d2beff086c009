"""phase.zarr, calibration.json and the texture photo → cloud.zarr and cloud.ply."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rahas.params import CloudParams
from rahas.stages.cloud import Cloud, make_cloud
from rahas.stages.consistency import Consistency, check_consistency
from rahas.stages.first_hold import first_hold_of
from rahas.stages.rig import rig_from_json
from rahas.stages.rotation_frames import rotation_of_timeline
from rahas.stores.arrays import open_store, writing_store
from rahas.stores.atomic import read_json
from rahas.stores.layout import ScanFolder
from rahas.stores.photos import read_texture
from rahas.stores.ply import write_cloud

_DIMS = ("y", "x")


def run(scan: ScanFolder, *, calibration: ScanFolder, texture: Path | None, params: CloudParams) -> None:
    """Triangulate a scan with its calibration."""
    phase = open_store(scan.phase)
    rig = rig_from_json(read_json(calibration.calibration))
    cloud = make_cloud(
        unwrapped_phase=phase["unwrapped_phase"][...],
        phase_std=phase["phase_std"][...],
        background=phase["background"][...],
        rig=rig,
        photo=None if texture is None else read_texture(texture),
        params=params,
    )
    consistency = check_consistency(
        rig,
        first_hold_of(open_store(scan.frames)["frames"], rotation_of_timeline(read_json(scan.timeline))),
        unwrapped_phase=phase["unwrapped_phase"][...],
        background=phase["background"][...],
        modulation=phase["modulation"][...],
    )
    _write_store(scan, calibration, cloud, consistency)
    write_cloud(
        scan.cloud_ply,
        cloud.points,
        mask=np.isfinite(cloud.points[..., 0]),
        normals=cloud.normals,
        colour=cloud.colour,
        scalars={"modulation": phase["modulation"][...], "z_std": cloud.z_std},
        comment=f"RAHAS scan {scan.scan_id}, calibration {calibration.scan_id}\n"
        "mm in the target's frame: x right, y up, z towards the camera",
    )


def _write_store(scan: ScanFolder, calibration: ScanFolder, cloud: Cloud, consistency: Consistency | None) -> None:
    attributes = {
        "scan_id": scan.scan_id,
        "calibration": calibration.scan_id,
        "measured_share": cloud.measured_share,
        "ripple_before_rad": cloud.debanded.ripple_before.tolist(),
        "ripple_after_rad": cloud.debanded.ripple_after.tolist(),
        "ripple_std_rad": cloud.debanded.ripple_std.tolist(),
        "ripple_orders_removed": list(cloud.debanded.orders_removed),
        "calibration_consistency": None if consistency is None else consistency._asdict(),
        "warnings": cloud.warnings,
    }
    points: dict[str, Any] = {"units": "mm", "fill_value": np.nan}
    with writing_store(scan.cloud, **attributes) as store:
        store.put("xyz", (*_DIMS, "axis"), cloud.points, long_name="surface points, debanded", **points)
        store.put(
            "xyz_before_debanding",
            (*_DIMS, "axis"),
            cloud.points_before_debanding,
            long_name="surface points before debanding",
            **points,
        )
        store.put("z_std", _DIMS, cloud.z_std, long_name="standard deviation of z", units="mm", fill_value=np.nan)
        store.put("rgb", (*_DIMS, "channel"), cloud.colour, long_name="red, green, blue", units="1")
