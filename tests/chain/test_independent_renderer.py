"""An expedition filmed by a renderer that is not this project's, kept outside it (expedition_c in RAHAS_EXTRA_DATA)."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from rahas.stores.layout import ScanFolder
from rahas.typing import AnyArray
from tests.chain.accuracy import score_depth, score_phase
from tests.chain.command_line import qa_of, run_snakemake, verdict_of

STRIPES, STOP_DEG, CENTRE = 20, 90.6, (0.02, 0.015)
EXPECTED = {
    "calC": "accepted",
    "tricircleC": "accepted",
    "farC": "rejected object_span",
    "interlacedC": "accepted",
    "bumpedC": "rejected jitter",
}


@pytest.fixture(scope="module")
def source(extra_data: Path) -> Path:
    for folder in (extra_data / "expedition_c", extra_data):
        if (folder / "truth" / "tricircleC.npz").is_file():
            return folder
    pytest.skip(f"{extra_data.name} holds no expedition_c")


@pytest.fixture(scope="module")
def expedition(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A processed copy."""
    root = tmp_path_factory.mktemp("independent") / "expedition"
    shutil.copytree(source, root, ignore=shutil.ignore_patterns("truth", "results", ".snakemake"))
    run_snakemake(root)
    return root


def true_phase(truth: dict[str, AnyArray]) -> AnyArray:
    angle = np.deg2rad(STOP_DEG)
    u, v = truth["u"].astype(np.float64) - CENTRE[0], truth["v"].astype(np.float64) - CENTRE[1]
    return np.pi * STRIPES * (u * np.cos(angle) + v * np.sin(angle))


def test_verdicts(expedition: Path) -> None:
    assert {scan_id: verdict_of(expedition, scan_id) for scan_id in EXPECTED} == EXPECTED


def test_measures_that_decided(expedition: Path) -> None:
    """The README's figures: 3.4 px rms in the worst second; about a fifth of the width."""
    bumped, far = qa_of(expedition, "bumpedC")["reasons"][0], qa_of(expedition, "farC")["reasons"][0]
    assert bumped["value"] == pytest.approx(3.4, abs=0.4)
    assert far["value"] == pytest.approx(0.2, abs=0.05)


@pytest.mark.parametrize(("scan_id", "median_mm", "rms_mm"), [("tricircleC", 0.13, 0.25), ("interlacedC", 0.2, 0.4)])
def test_depth_against_truth(expedition: Path, source: Path, scan_id: str, median_mm: float, rms_mm: float) -> None:
    truth = dict(np.load(source / "truth" / f"{scan_id}.npz"))
    scan = ScanFolder(expedition / "results", scan_id)
    phase = score_phase(scan, true_phase(truth), truth["lit"])
    depth = score_depth(scan, truth["world_target"], truth["lit"])
    print(f"{scan_id}: {phase}\n{scan_id}: {depth}")
    assert phase.wrong_orders <= 0.001
    assert depth.coverage >= 0.97
    assert 0.03 < depth.median_mm <= median_mm
    assert depth.rms_mm <= rms_mm
    assert 0.8 <= depth.normalised_68 <= 1.35
