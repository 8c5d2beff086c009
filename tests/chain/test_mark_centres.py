"""The marks' centres, corrected for perspective, lie where they really are."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rahas.kernels.camera import Camera, project
from rahas.kernels.roof import fit_roof
from rahas.simulate.examples import example
from rahas.simulate.roof import DIAMETER_MM, target_marks
from rahas.stages.sighting import Target, sight_target
from rahas.stores.arrays import open_store
from rahas.stores.layout import ScanFolder
from tests.chain.bench import film, process, write_target


def test_no_bias_above_the_noise(tmp_path: Path) -> None:
    capture = example("roof", short=True, seed=5, target={"yaw_deg": 8.0, "pitch_deg": 6.0})
    path, truth = film(tmp_path / "captures", "cal", capture)
    scan = ScanFolder(tmp_path / "results", "cal")
    assert process(scan, path, target=write_target(tmp_path / "target.csv")).verdict == "accepted"
    world = np.array(target_marks())
    found = sight_target(
        open_store(scan.phase)["background"][...],
        Target(np.arange(1, 19), world, np.full(18, DIAMETER_MM)),
        fit_roof(world),
        min_marks=18,
        radial_significance=4.0,
    )
    middle = np.array([(capture.rig.width_px - 1) / 2, (capture.rig.height_px - 1) / 2])
    true = project(Camera(truth["camera_matrix"], 0.0, middle), world[found.row])
    error, uncorrected = found.centre - true, found.ellipse_centre - true
    noise = np.sqrt(np.mean(error**2))
    print(f"mean {error.mean(axis=0)}, rms {noise:.4f} px; uncorrected rms {np.sqrt(np.mean(uncorrected**2)):.4f} px")
    assert 0.002 < noise < 0.03
    assert np.abs(error.mean(axis=0)).max() < 0.01
    assert np.sqrt(np.mean(uncorrected**2)) > 1.3 * noise, "perspective must matter here"
