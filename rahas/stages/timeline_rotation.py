"""The rotation: slide angle of every frame, and where the slide leaves and reaches its stops."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.kernels.carrier import demodulate, ramp_slope
from rahas.kernels.frame_runs import first_beyond, last_beyond, running_median
from rahas.kernels.orientation import slide_angle_from_tensors
from rahas.kernels.pattern_light import light_from_images
from rahas.stages.timeline_overview import Overview, noise_tensors, tensors_of
from rahas.stages.timeline_scan import Scan, carrier_at
from rahas.typing import FloatArray, FrameStack

NEAR_DEG, FAR_DEG = 5.0, 10.0
"""The ramp along the hold's stripes tells the angle up to NEAR_DEG, the stripes' direction from FAR_DEG on."""


class Rotation(NamedTuple):
    """The slide's turn."""

    first: int
    last: int
    angle_deg: FloatArray
    """(frame) of the whole capture: 0 at the first stop, 90 at the second, NaN in the dark."""


def find_rotation(
    thumbnails: FrameStack, overview: Overview, scan: Scan, *, threshold_deg: float, median_frames: int, scale: float
) -> Rotation:
    """Slide angles and borders of the rotation, given the scan and its reference hold."""
    begin, stop = overview.lit_first, scan.hold_last + 1
    off_first = _off_first_stop(thumbnails, overview, scan, scale=scale)
    off_second = _off_second_stop(thumbnails, overview, scan, across=off_first.wave_number, scale=scale)
    between = _between(thumbnails, overview, scan, off_first.held, scale=scale)
    near, far = between[: len(off_first.angle_deg)], between[len(between) - len(off_second.angle_deg) :]
    angle = between.copy()
    angle[: len(near)] = _blend(off_first.angle_deg, near, size=near)
    angle[len(between) - len(far) :] = 90 - _blend(off_second.angle_deg, 90 - far, size=90 - far)
    calm = running_median(angle, median_frames)
    first = first_beyond(calm, threshold_deg)
    last = last_beyond(calm - 90, threshold_deg)
    whole = np.full(thumbnails.shape[0], np.nan)
    whole[begin:stop] = np.clip(angle, 0, 90)
    whole[stop : overview.lit_last + 1] = 90
    return Rotation(begin + first, begin + last, whole)


class _OffStop(NamedTuple):
    """Angles off a stop by the ramp along that hold's stripes."""

    angle_deg: FloatArray
    held: int
    wave_number: float


def _off_first_stop(thumbnails: FrameStack, overview: Overview, scan: Scan, *, scale: float) -> _OffStop:
    """Angle off the first stop of the frames from lamp on to some way into the turn."""
    begin, stop = overview.lit_first, overview.turn_first + 1
    held, carrier, angle = 3, None, np.zeros(0)
    for _ in range(2):
        carrier = carrier_at(
            thumbnails, overview, frames=slice(begin + min(1, held - 1), begin + held), axis=1, scale=scale
        )
        sums = demodulate(thumbnails, carrier, background=scan.pattern.background, first=begin, stop=stop, scale=scale)
        slope = ramp_slope(sums, held=slice(min(1, held - 1), held)) * overview.sense / scan.carrier.wave_number
        angle = np.degrees(np.arcsin(np.clip(slope, -1, 1)))
        held = max(3, first_beyond(angle, 0.15))
    assert carrier is not None
    return _OffStop(angle, held, carrier.wave_number)


def _off_second_stop(
    thumbnails: FrameStack, overview: Overview, scan: Scan, *, across: float, scale: float
) -> _OffStop:
    """Angle before the second stop of the frames from some way before it to the hold."""
    sums = demodulate(
        thumbnails,
        scan.carrier,
        background=scan.pattern.background,
        first=overview.turn_last,
        stop=scan.hold_last + 1,
        scale=scale,
    )
    held = slice(scan.hold_first - overview.turn_last, len(sums))
    slope = ramp_slope(sums, held=held) * overview.sense / across
    return _OffStop(np.degrees(np.arcsin(np.clip(slope, -1, 1))), 0, scan.carrier.wave_number)


def _between(thumbnails: FrameStack, overview: Overview, scan: Scan, held: int, *, scale: float) -> FloatArray:
    """Slide angle from the stripes' direction, of the frames from lamp on to the hold before the scan."""
    light = light_from_images(
        background=scan.pattern.background,
        contrast=scan.pattern.modulation / np.sqrt(2),
        noise=overview.change.noise,
    )
    begin, stop = overview.lit_first, scan.hold_last + 1
    noise = noise_tensors(thumbnails, overview.change.rms, light, scale=scale, first=begin, stop=overview.lit_last + 1)
    tensors = tensors_of(thumbnails, light, scale=scale, first=begin, stop=stop).less(noise).of_even_strength()
    return slide_angle_from_tensors(
        tensors,
        first_stop=tensors[min(1, held - 1) : held].mean(0),
        second_stop=tensors[scan.hold_first - begin :].mean(0),
        sense=overview.sense,
    )


def _blend(ramp: FloatArray, direction: FloatArray, *, size: FloatArray) -> FloatArray:
    """The ramp's angle near the stop, the direction's far from it."""
    share = np.clip((FAR_DEG - size) / (FAR_DEG - NEAR_DEG), 0, 1)
    return share * ramp + (1 - share) * direction
