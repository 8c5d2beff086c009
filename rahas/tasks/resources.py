"""Memory and time that a job is given on a cluster, from what is known before it runs: the capture's size.

One table holds all constants. They were measured (docs/CLUSTER.md has figures and commands) and are held by
tests/tasks/test_resources.py: what is asked for is never less than what was measured, and never wastefully more.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rahas.stores.capture_size import CaptureSize

UNKNOWN = CaptureSize(frames=900, pixels=1920 * 1080)
"""taken for a capture whose header tells nothing"""
NODE_MB = 300
"""the Snakemake processes that watch a job on its node"""
MEMORY_MARGIN = 1.3
TIME_MARGIN = 5.0
"""for nodes and file systems slower than the machine that was measured on"""
START_MIN = 2.0
"""Snakemake on the node, imports, first compiled kernels"""


class Need(NamedTuple):
    """What one job was measured to need, as a line through the measurements."""

    base_mb: float
    """resident whatever the frames' size"""
    mb_per_frame_mb: float
    """for each megabyte of one frame's luma"""
    s_per_total_megapixel: float
    """for each 10⁶ pixels of all frames together"""


NEEDS = {
    "simulate": Need(300, 400, 0.4),
    "capture": Need(222, 35, 0.045),
    "phase": Need(350, 65, 0.06),
    "calibrate": Need(115, 85, 0.02),
    "surface": Need(160, 100, 0.02),
}


def memory_mb(job: str, size: CaptureSize | None, attempt: int = 1) -> int:
    """MB to ask for; twice as many at the second attempt, three times at the third."""
    need, size = NEEDS[job], size or UNKNOWN
    expected = NODE_MB + MEMORY_MARGIN * (need.base_mb + need.mb_per_frame_mb * size.megabytes)
    return math.ceil(expected / 50) * 50 * attempt


def runtime_min(job: str, size: CaptureSize | None, attempt: int = 1) -> int:
    """Whole minutes to ask for; more at further attempts, likewise."""
    size = size or UNKNOWN
    seconds = TIME_MARGIN * NEEDS[job].s_per_total_megapixel * size.total_megapixels
    return math.ceil(START_MIN + seconds / 60) * attempt
