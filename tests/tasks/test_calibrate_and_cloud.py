"""calibration.json, cloud.zarr and cloud.ply as they are read later; and the rig of an independent renderer."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import jsonschema
import numpy as np
import pytest
import xarray

from rahas.errors import CaptureProblem
from rahas.kernels.projector import phase_of_projector
from rahas.params import CalibrationParams, CloudParams
from rahas.stores.arrays import open_store, writing_store
from rahas.stores.atomic import read_json, write_json
from rahas.stores.layout import ScanFolder
from rahas.tasks import calibrate, cloud
from tests.roof_scene import camera_at, first_stop_above, projector_above, roof_target, see_relief, see_roof

CAMERA, PROJECTOR = camera_at(), projector_above()


def write_phase(
    scan: ScanFolder, phase: np.ndarray, background: np.ndarray, std: float, first: np.ndarray | None = None
) -> None:
    """What the tasks read; ``first`` is the phase at the first stop, without which the first hold shows no stripes."""
    seen = np.isfinite(phase)
    hold = background + (0.0 if first is None else 30.0 * np.cos(first))
    with writing_store(scan.frames) as store:
        store.put("frames", ("frame", "y", "x"), np.repeat(hold[None].clip(0, 255).astype(np.uint8), 12, axis=0))
    intervals = [{"stage": "hold", "first": 0, "last": 9}, {"stage": "rotation", "first": 10, "last": 11}]
    write_json(scan.timeline, {"intervals": intervals, "slide_angle_deg": [0.0] * 12, "rotation_sense": 1})
    with writing_store(scan.phase) as store:
        store.put("unwrapped_phase", ("y", "x"), phase.astype(np.float32))
        store.put("phase_std", ("y", "x"), np.where(seen, std, np.nan).astype(np.float32))
        store.put("background", ("y", "x"), background.astype(np.float32))
        store.put("modulation", ("y", "x"), np.where(seen, 30.0, np.nan).astype(np.float32))


def write_target(path: Path) -> Path:
    rows = [f"{i + 1},{x},{y},{z}" for i, (x, y, z) in enumerate(roof_target())]
    path.write_text("mark,x_mm,y_mm,z_mm\n" + "\n".join(rows[::-1]) + "\n", encoding="utf-8")
    return path


def test_from_phase_to_files(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    target = ScanFolder(tmp_path / "results", "cal")
    roof = see_roof(CAMERA, PROJECTOR)
    first = phase_of_projector(first_stop_above(), roof.points)
    write_phase(target, roof.unwrapped_phase + rng.normal(0, 0.01, roof.image.shape), roof.image + 20.0, 0.01, first)
    table = write_target(tmp_path / "target.csv")
    photo = tmp_path / "cal_texture.png"
    cv2.imwrite(str(photo), np.repeat(roof.image.astype(np.uint8)[..., None], 3, axis=2))
    calibrate.run(target, target=table, texture=photo, params=CalibrationParams())
    calibration = read_json(target.calibration)
    schema = Path(__file__).parents[2] / "docs" / "schemas" / "calibration.schema.json"
    jsonschema.validate(calibration, read_json(schema))
    assert calibration["scan_id"] == "cal"
    assert calibration["residuals"]["camera_rms_px"] < 0.1
    assert calibration["texture_camera"]["width_px"] == 360
    assert set(calibration["covariance"]["parameters"]) < set(calibration["standard_deviations"])
    assert calibration["first_stop"] is not None

    scan = ScanFolder(tmp_path / "results", "scan")
    relief = see_relief(CAMERA, PROJECTOR)
    first = phase_of_projector(first_stop_above(), relief.points)
    noisy = relief.unwrapped_phase + rng.normal(0, 0.01, relief.image.shape)
    write_phase(scan, noisy, relief.image, 0.01, first + 0.1)
    cloud.run(scan, calibration=target, texture=photo, params=CloudParams())
    with xarray.open_zarr(scan.cloud) as store:
        assert store["xyz"].dims == ("y", "x", "axis")
        assert store["rgb"].dtype == np.uint8
        error = store["xyz"].values - relief.points
        assert store.attrs["calibration"] == "cal"
        assert len(store.attrs["ripple_before_rad"]) == 4
        assert store.attrs["calibration_consistency"]["offset_rad"] == pytest.approx(
            0.13, abs=0.02
        )  # 0.1/(1 − 0.25): this camera stands askew
        assert store.attrs["calibration_consistency"]["gradient_rad"] < 0.02
    assert np.nanmedian(np.abs(error[..., 2])) < 0.15
    points = int(np.isfinite(error[..., 2]).sum())
    assert f"element vertex {points}\n".encode() in scan.cloud_ply.read_bytes()[:400]


def test_broken_photo_rejects(tmp_path: Path) -> None:
    scan = ScanFolder(tmp_path / "results", "cal")
    write_phase(scan, np.zeros((40, 60)), np.ones((40, 60)), 0.01)
    (tmp_path / "photo.jpg").write_text("no photo")
    with pytest.raises(CaptureProblem, match=r"photo\.jpg"):
        calibrate.run(
            scan, target=write_target(tmp_path / "t.csv"), texture=tmp_path / "photo.jpg", params=CalibrationParams()
        )


def test_rig_of_another_renderer(tmp_path: Path) -> None:
    """Axes, signs, mark order and units fit captures that this project did not make (exact phases, their photos)."""
    folder = os.environ.get("RAHAS_EXTRA_DATA")
    if not folder:
        pytest.skip("RAHAS_EXTRA_DATA names no folder of captures with truth")
    expedition = Path(folder) / "expedition_c"
    if not expedition.is_dir():
        expedition = Path(folder)
    rng = np.random.default_rng(4)
    truth = {name: np.load(expedition / "truth" / f"{name}.npz") for name in ("calC", "tricircleC")}
    photo = expedition / "captures" / "calC_texture.png"
    # the video camera's own image of the marks: dark where the truth has a mark, as no video is read here
    points = truth["calC"]["world_target"].astype(float)
    table = np.genfromtxt(expedition / "config" / "target.csv", delimiter=",", skip_header=1)[:, 1:4]
    distance = np.min(np.linalg.norm(points[:, :, None] - table, axis=-1), axis=-1)
    background = cv2.GaussianBlur(np.where(distance < 9.0, 12.0, 120.0), (0, 0), 0.8)
    for name, values in truth.items():
        angle = np.deg2rad(90.6)
        phase = np.pi * 20 * ((values["u"] - 0.02) * np.cos(angle) + (values["v"] - 0.015) * np.sin(angle))
        phase = np.where(values["lit"], phase + rng.normal(0, 0.02, phase.shape), np.nan)
        write_phase(ScanFolder(tmp_path, name), phase, background, 0.02)
    calibration = ScanFolder(tmp_path, "calC")
    calibrate.run(calibration, target=expedition / "config" / "target.csv", texture=photo, params=CalibrationParams())
    residuals = read_json(calibration.calibration)["residuals"]
    assert residuals["marks_found"] == 18
    assert residuals["camera_rms_px"] < 0.3
    assert residuals["texture_camera_rms_px"] < 0.1
    scan = ScanFolder(tmp_path, "tricircleC")
    cloud.run(scan, calibration=calibration, texture=None, params=CloudParams())
    store = open_store(scan.cloud)
    error = store["xyz"][...] - truth["tricircleC"]["world_target"]
    assert 0.1 < np.nanmedian(np.abs(error[..., 2])) < 0.2, "20 mrad are 0.23 mm (rms) here"
    assert np.abs(np.nanmedian(error, axis=(0, 1))).max() < 0.03
    assert 0.9 < np.nanstd(error[..., 2] / store["z_std"][...]) < 1.1
