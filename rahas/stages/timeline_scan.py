"""The scan: the hold that all phases refer to, and the pattern's phase step in every frame after it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.carrier import Carrier, carrier_from_stripes, demodulate, ramp_slope
from rahas.kernels.frame_blocks import frame_blocks
from rahas.kernels.frame_runs import first_beyond, last_beyond, running_median
from rahas.kernels.phase_steps import ScanPattern, advanced_iterative_steps, pattern_from_steps, with_zero_at
from rahas.stages.timeline_overview import Overview, timeline_problem
from rahas.typing import Float32Array, FloatArray, FrameStack

LEAST_SCAN_RAD = 0.5
"""A pattern that moved less than this was not scanned at all."""
CRANK_MOVED_RAD = 0.15
"""More than the last half degree of the slide's turn can move the pattern at the field's centre."""
SAMPLES = 3000
SAMPLE_BUDGET = 12_000_000
"""Pixels sampled for the steps, and pixels times frames at most."""
CENTRE_WIDTH = 0.12
"""Standard deviation of the window in which the steps are measured, as a share of the image's height."""


class Scan(NamedTuple):
    """Hold before the scan, and the scan."""

    hold_first: int
    hold_last: int
    """Frames about the reference slide position: the steps' zero."""
    still_from: int
    """First frame from which on the crank rested before the scan."""
    scan_first: int
    scan_last: int
    step: FloatArray
    """(frame) of the whole capture, radians; NaN before the hold and in the dark."""
    pattern: ScanPattern
    carrier: Carrier
    """Stripes of the hold before the scan."""


class _Tail(NamedTuple):
    """Everything from the end of the turn on, against one frame's stripes as carrier."""

    turn_deg: FloatArray
    """Slide angle off the carrier's."""
    step: FloatArray
    """Rough phase step, unwrapped."""


def find_scan(
    thumbnails: FrameStack, overview: Overview, *, threshold_rad: float, median_frames: int, scale: float
) -> Scan:
    """Reference hold, steps and borders of the scan.

    Raises
    ------
    CaptureProblem
        Nothing was scanned, or the crank moved before the lever had arrived.
    """
    begin, stop = overview.turn_last, overview.lit_last + 1
    across = carrier_at(
        thumbnails, overview, frames=slice(overview.lit_first + 1, overview.lit_first + 4), axis=1, scale=scale
    )
    last = max(begin, stop - 2)
    provisional = carrier_at(thumbnails, overview, frames=slice(last, last + 1), axis=0, scale=scale)
    held = slice(last - begin, last - begin + 1)
    tail = _against(
        thumbnails, provisional, across.wave_number, overview, held=held, begin=begin, stop=stop, scale=scale
    )
    span = float(np.ptp(running_median(tail.step, median_frames)[_settled(tail.turn_deg) :]))
    if span < LEAST_SCAN_RAD:
        raise timeline_problem(
            "The lever was turned, but the pattern never moved afterwards: the crank was not turned, or filming "
            "ended too early. After the lever has reached its stop, wait a second, then crank slowly by more "
            "than one stripe.",
            "lamp on, hold, rotation, no scan",
        )
    first, final = _hold(tail)
    carrier = carrier_at(thumbnails, overview, frames=slice(begin + first, begin + final + 1), axis=0, scale=scale)
    held = slice(first, final + 1)
    tail = _against(thumbnails, carrier, across.wave_number, overview, held=held, begin=begin, stop=stop, scale=scale)
    first, final = _hold(tail)
    hold = slice(0, final - first + 1)
    start = with_zero_at(tail.step[first:], hold)
    samples, weight = _centre_samples(thumbnails, overview, begin + first, stop, scale=scale)
    steps = with_zero_at(advanced_iterative_steps(samples, weight, start=start).step, hold)
    calm = running_median(steps, median_frames)
    resting = float(calm[-2:].mean())
    scan_first = first_beyond(calm, threshold_rad)
    scan_last = max(last_beyond(calm - resting, threshold_rad), scan_first)
    whole = np.full(thumbnails.shape[0], np.nan)
    whole[begin + first : stop] = steps
    return Scan(
        hold_first=begin + first,
        hold_last=begin + final,
        still_from=begin + 1 + last_beyond(tail.step[: first + 1] - tail.step[first], CRANK_MOVED_RAD),
        scan_first=begin + first + scan_first,
        scan_last=begin + first + min(scan_last, len(steps) - 1),
        step=whole,
        pattern=pattern_from_steps(thumbnails, steps, first=begin + first, scale=scale),
        carrier=carrier,
    )


def carrier_at(thumbnails: FrameStack, overview: Overview, *, frames: slice, axis: int, scale: float) -> Carrier:
    """The stripes of ``frames`` (their mean) as a carrier along ``axis``."""
    mean = np.mean([values.mean(0) for _, values in frame_blocks(thumbnails[frames], scale=scale)], axis=0)
    return carrier_from_stripes((mean - overview.light.background) * overview.light.weight, axis=axis)


def _against(
    thumbnails: FrameStack,
    carrier: Carrier,
    across: float,
    overview: Overview,
    *,
    held: slice,
    begin: int,
    stop: int,
    scale: float,
) -> _Tail:
    sums = demodulate(thumbnails, carrier, background=overview.light.background, first=begin, stop=stop, scale=scale)
    turn = np.degrees(np.arcsin(np.clip(ramp_slope(sums, held=held) / across, -1, 1)))
    window = _centre_window(carrier.signal.shape)
    centred = carrier._replace(signal=carrier.signal * window)
    sums = demodulate(thumbnails, centred, background=overview.light.background, first=begin, stop=stop, scale=scale)
    return _Tail(turn, np.unwrap(np.angle(sums.sum(1))))


def _settled(turn_deg: FloatArray) -> int:
    """First frame within 1° of where the slide ends up."""
    final = float(np.median(turn_deg[-max(3, len(turn_deg) // 3) :]))
    return min(int(np.argmax(np.abs(turn_deg - final) < 1.0)), len(turn_deg) - 1)


def _hold(tail: _Tail) -> tuple[int, int]:
    """First and last frame of the quietest stretch between the slide's arrival and the crank's start."""
    arrived = _settled(tail.turn_deg)
    gone = arrived + first_beyond(tail.step[arrived:] - tail.step[arrived], 1.0)
    pace = np.abs(np.gradient(tail.step)) + np.abs(np.gradient(tail.turn_deg)) / 2
    pace = np.convolve(np.pad(pace, 1, mode="edge"), np.ones(3) / 3, "valid")
    calm = arrived + int(np.argmin(pace[arrived : max(gone, arrived + 1)]))
    near = (np.abs(tail.step - tail.step[calm]) < 0.02) & (np.abs(tail.turn_deg - tail.turn_deg[calm]) < 0.15)
    first = calm - int(np.argmin(near[calm::-1])) + 1 if not near[: calm + 1].all() else 0
    last = calm + int(np.argmin(near[calm:])) - 1 if not near[calm:].all() else len(near) - 1
    return first, last


def _centre_samples(
    thumbnails: FrameStack, overview: Overview, first: int, stop: int, *, scale: float
) -> tuple[Float32Array, Float32Array]:
    """Grey levels (frame, pixel) of well-lit pixels about the image's centre, and their weights."""
    weight = overview.light.weight * overview.light.contrast**2
    weight = weight / weight.max() * _centre_window(weight.shape)
    count = min(SAMPLES, max(300, SAMPLE_BUDGET // (stop - first)), weight.size)
    chosen = np.argpartition(-weight.ravel(), count - 1)[:count]
    samples = np.empty((stop - first, count), np.float32)
    for frames, values in frame_blocks(thumbnails, first=first, stop=stop, scale=scale):
        samples[frames.start - first : frames.stop - first] = values.reshape(len(values), -1)[:, chosen]
    weight = weight.ravel()[chosen]
    return samples, (weight / weight.max()).astype(np.float32)


def _centre_window(shape: tuple[int, ...]) -> FloatArray:
    """Weights about the image's centre, with a faint tail for an object that does not reach it."""
    height, width = shape
    y, x = np.mgrid[:height, :width]
    away = ((y - (height - 1) / 2) ** 2 + (x - (width - 1) / 2) ** 2) / (CENTRE_WIDTH * height) ** 2
    return np.asarray(np.exp(-0.5 * away) + 1e-6 / (1 + away))
