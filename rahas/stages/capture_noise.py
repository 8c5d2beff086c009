"""Noise of one frame of a capture, by grey level, from its holds and its scan."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rahas.kernels.modulation import StripeFit
from rahas.kernels.noise import NoiseCurve, combined_noise, noise_from_differences, noise_from_residual
from rahas.stages.moments import Moments
from rahas.stages.timeline_spans import stage_spans
from rahas.typing import FloatArray

_FAR_FRAMES = 12
_PAIRS_A_HOLD = 4
_TRIPLES = 8


def capture_noise(
    moments: Moments, fit: StripeFit, timeline: Mapping[str, Any], steps: FloatArray, *, top_level: float
) -> NoiseCurve:
    """Noise curve of a capture.

    Parameters
    ----------
    steps
        (frame,) phase steps in radians, NaN outside the scan.
    top_level
        Highest grey level that the frames can hold.
    """
    return combined_noise(
        still=_still_noise(moments, timeline, top_level),
        moving=_moving_noise(moments, fit, steps, top_level),
        residual=noise_from_residual(fit.residual, fit.background, top_level=top_level),
        lit_level=float(np.median(fit.background[fit.modulation >= np.percentile(fit.modulation, 90)])),
    )


def _still_noise(moments: Moments, timeline: Mapping[str, Any], top_level: float) -> NoiseCurve | None:
    """From frames of a hold that lie far apart: codecs carry a frame's noise over to the next ones."""
    numbers: list[int] = []
    for hold in stage_spans(timeline, "hold"):
        first, last = hold.first + 1, hold.last - 1
        apart = min(_FAR_FRAMES, (last - first) // 2)
        if apart >= 1:
            for n in np.unique(np.linspace(first, last - apart, _PAIRS_A_HOLD).astype(int)):
                numbers += [int(n), int(n) + apart]
    pairs = moments.samples(numbers).reshape(-1, 2, *moments.shape).astype(np.float32)
    return noise_from_differences(pairs[:, 1] - pairs[:, 0], pairs.mean(axis=1), gain=2.0, top_level=top_level)


def _moving_noise(moments: Moments, fit: StripeFit, steps: FloatArray, top_level: float) -> NoiseCurve | None:
    """From second differences of consecutive frames of the scan, the stripes' own part taken out."""
    inner = np.flatnonzero(np.isfinite(steps[:-2]) & np.isfinite(steps[1:-1]) & np.isfinite(steps[2:])) + 1
    if not len(inner):
        return None
    middles = inner[np.unique(np.linspace(0, len(inner) - 1, _TRIPLES).astype(int))]
    triples = moments.samples([int(n) + k for n in middles for k in (-1, 0, 1)])
    triples = triples.reshape(-1, 3, *moments.shape).astype(np.float32)
    turn = np.exp(1j * steps[middles - 1]) - 2 * np.exp(1j * steps[middles]) + np.exp(1j * steps[middles + 1])
    shown = (fit.modulation * np.exp(1j * fit.wrapped_phase)).astype(np.complex64)
    seconds = triples[:, 0] - 2 * triples[:, 1] + triples[:, 2]
    seconds -= np.stack([(shown * np.complex64(t)).real for t in turn])
    return noise_from_differences(seconds, triples.mean(axis=1), gain=6.0, top_level=top_level)
