"""The thesis's own phase (`phase: {method: thesis}`) on the same frames and snakes: the baseline of every figure."""

from __future__ import annotations

from pathlib import Path

import pytest

from rahas.params import CalibrationParams, CloudParams, PhaseParams
from rahas.stores.layout import ScanFolder
from rahas.tasks import calibrate, cloud, phase
from tests.chain.accuracy import MIN_ALBEDO, DepthScore, PhaseScore, score_depth, score_phase
from tests.chain.conftest import River

BEFORE_PHASE = ("frames.zarr", "timeline.json", "snakes.zarr")


def solved_again(river: River, root: Path, params: PhaseParams) -> tuple[PhaseScore, DepthScore]:
    """Phase, calibration and cloud by another method, from what the session has tracked already."""
    scans = {name: ScanFolder(root / "results", name) for name in ("cal", "keeper")}
    for name, scan in scans.items():
        scan.path.mkdir(parents=True)
        for artifact in BEFORE_PHASE:
            (scan.path / artifact).symlink_to(river.root / "results" / name / artifact)
    phase.run(scans["cal"], calibration=None, params=params)
    calibrate.run(scans["cal"], target=river.root / "target.csv", texture=None, params=CalibrationParams())
    phase.run(scans["keeper"], calibration=scans["cal"], params=params)
    cloud.run(scans["keeper"], calibration=scans["cal"], texture=None, params=CloudParams())
    truth = river.truth["keeper"]
    lit = truth["lit"] & (truth["albedo"] > MIN_ALBEDO)
    return (
        score_phase(scans["keeper"], truth["unwrapped_phase"], lit),
        score_depth(scans["keeper"], truth["world_target"], lit),
    )


@pytest.mark.parametrize(("method", "coverage"), [("thesis", (0.6, 0.85)), ("least_squares", (0.97, 1.0))])
def test_simpler_methods_end_with_a_cloud_and_are_worse(
    river: River, tmp_path: Path, method: str, coverage: tuple[float, float]
) -> None:
    """Rows are blanked beside each snake by the thesis; one step a frame cannot follow a tilting projector."""
    phases, depth = solved_again(river, tmp_path, PhaseParams.model_validate({"method": method}))
    truth = river.truth["keeper"]
    joint = score_depth(river.keeper.scan, truth["world_target"], truth["lit"] & (truth["albedo"] > MIN_ALBEDO))
    print(f"{method}: {phases}\n{method}: {depth}\njoint: {joint}")
    assert coverage[0] <= depth.coverage <= coverage[1]
    assert phases.wrong_orders <= 0.001
    assert 0.02 < phases.rms_rad < 0.12
    assert 3 * joint.median_mm < depth.median_mm <= 0.5
