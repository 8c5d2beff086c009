"""Phase and cloud of a 1920 × 1080 capture stay below the memory that a job may take."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
IMAGE_MB = 1920 * 1080 * 4 / 2**20  # a map of single precision: what a stage returns is some of them


def run(stage: str, folder: Path) -> list[float]:
    """Figures that ``memory_of_stage`` prints, from a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    said = subprocess.run(
        [sys.executable, "-m", "tests.stages.memory_of_stage", stage, str(folder)],
        check=True, capture_output=True, text=True, cwd=ROOT, env=environment,
    )  # fmt: skip
    return [float(line) for line in said.stdout.split()]


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory is read from /proc")
@pytest.mark.parametrize("stage", ["phase", "cloud"])
def test_a_large_image_fits(stage: str, tmp_path: Path) -> None:
    if stage == "phase":
        run("film", tmp_path)
    peak_mb, share = run(stage, tmp_path)
    assert 12 * IMAGE_MB < peak_mb < 430
    assert 0.95 < share <= 1.0
