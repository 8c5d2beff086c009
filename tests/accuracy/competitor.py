"""The competitor: computer-controlled multi-frequency phase measuring, with as many frames as the crank's scan has.

Ideal: a projector that stands still, perfect even steps, frequencies f, f/6, f/36, frames shared equally among them;
same rig, scene, light and camera noise, rendered by the same simulator.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.phase_shifting import HarmonicSums, weights_of_least_squares, wrap
from rahas.simulate.capture import Staged
from rahas.simulate.frames import render_frames
from rahas.simulate.hand import Motion
from rahas.simulate.pattern import pattern_phase
from rahas.typing import FloatArray

DIVISORS = (1, 6, 36)


class Competitor(NamedTuple):
    """What the competitor measures."""

    phase_error: FloatArray  # (y, x) radians, of the finest pattern
    wrong_orders: float  # share of the lit pixels whose order the coarser patterns got wrong


def measure(staged: Staged, frames: int, lit: FloatArray) -> Competitor:
    """Measure the staged scene with ``frames`` frames in all."""
    per_pattern = frames // len(DIVISORS)
    counts = [max(1, round(staged.capture.rig.stripes / divisor)) for divisor in DIVISORS]
    found = [_one_pattern(staged, stripes, per_pattern) for stripes in counts]
    truth = _true_phase(staged, counts[0])
    coarse = found[-1]  # one period over the whole slide: no order to find
    for stripes, coarser, fine in zip(counts[-2::-1], counts[:0:-1], found[-2::-1], strict=True):
        coarse = fine + 2 * np.pi * np.rint((coarse * stripes / coarser - fine) / (2 * np.pi))
    error = coarse - truth
    return Competitor(wrap(error), float((np.abs(error) > np.pi)[lit].mean()))


def _one_pattern(staged: Staged, stripes: int, frames: int) -> FloatArray:
    # no edge of light: a computer's pattern is as large as it likes
    rig = staged.capture.rig.model_copy(update={"stripes": stripes, "crank": "translation", "aperture": 10.0})
    motion = _stepping(staged, frames, period=2.0 / stripes)
    steps = -2 * np.pi * np.arange(frames) / frames
    sums = HarmonicSums(staged.maps.u.shape, steps, weights_of_least_squares(steps))
    camera = staged.capture.camera.model_copy(update={"doubled": (), "dropped": (), "fields": "progressive"})
    seed = staged.capture.seed + 100 * stripes
    for frame in render_frames(staged.maps, rig, motion, camera, shows=np.arange(frames), seed=seed):
        sums.add(frame[None])
    return sums.maps().wrapped_phase


def _true_phase(staged: Staged, stripes: int) -> FloatArray:
    rig = staged.capture.rig.model_copy(update={"stripes": stripes, "crank": "translation"})
    u, v = staged.maps.u.astype(float), staged.maps.v.astype(float)
    return pattern_phase(rig, u, v, theta=np.deg2rad(rig.second_stop_deg), crank=0.0)


def _stepping(staged: Staged, frames: int, period: float) -> Motion:
    """A slide that stands still during each exposure and jumps between frames by an even share of its period."""
    rate = staged.capture.camera.frame_rate
    time = np.repeat(np.arange(frames), 2) / rate
    time[1::2] += 0.98 / rate
    nothing = np.zeros_like(time)
    stop = np.full_like(time, np.deg2rad(staged.capture.rig.second_stop_deg))
    crank = np.repeat(np.arange(frames) * (period / frames), 2)
    return Motion(time, np.ones_like(time), stop, crank, nothing, nothing)
