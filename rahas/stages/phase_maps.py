"""Scan frames → fringe maps: one step a frame for the whole field, or steps that vary over it, solved jointly."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from rahas.errors import CaptureProblem
from rahas.kernels.displacement import Slopes, moved_back, slopes_at
from rahas.kernels.joint_steps import StepField, across_image, levelled
from rahas.kernels.long_scan import solve_scan_steps
from rahas.kernels.noise_memory import phase_std_inflation
from rahas.kernels.phase_field import solve_phase_field
from rahas.kernels.phase_shifting import (
    FringeMaps,
    HarmonicSums,
    weights_of_even_resampling,
    weights_of_least_squares,
)
from rahas.kernels.pixel_fit import fit_pixels
from rahas.kernels.sampling import evenly_spread
from rahas.params import PhaseParams
from rahas.stages.frame_bands import FieldFrames, pixels_at
from rahas.typing import AnyArray, BoolArray, Float32Array, FloatArray, FrameStack

MARGIN = 4  # rows about a band that displaced frames are interpolated from
MOST_SAMPLES = 450_000  # pixels times frames of the joint solve: long scans have fewer pixels, not more memory
LASTING_POWER = 1.5
"""of the factor by which two halves of the frames differ more than white noise would have it: they share what lasts for
longer than their blocks (measured against truth on rendered H.264, crf 14 to 28, and MPEG-2: 1.2 to 1.9)"""
ENOUGH_SAMPLES = 130_000  # and a handful of frames has more pixels, to hold as much
MOST_PIXELS = 16_000
FEWEST_PIXELS = 200


def linear_maps(
    frames: FrameStack, first: int, steps: FloatArray, fields: list[slice], params: PhaseParams
) -> FringeMaps:
    """Fringe maps with one step (frame,) a frame: the thesis's resampling, or least squares over all frames.

    Raises
    ------
    CaptureProblem
        The crank scanned too little for a phase.
    """
    parts = [
        (field.rows, _linear_field(field, own, params)) for field, own in _field_frames(frames, first, steps, fields)
    ]
    return _woven(parts, frames.shape[1:])


class Steadied:
    """A field's frames with the object's displacement (frame, 2) undone."""

    def __init__(self, frames: FieldFrames, shift: FloatArray) -> None:
        self.field = frames
        self._shift = shift
        self._margin = int(np.ceil(np.abs(shift[:, 1]).max())) + MARGIN

    def blocks(self, band: slice) -> Iterator[AnyArray]:
        if not self._shift.any():
            return self.field.blocks(band)
        first, stop, _ = band.indices(self.field.shape[0])
        above = max(0, first - self._margin)
        wider = slice(above, stop + self._margin)
        own = slice(first - above, stop - above)
        return (block[:, own] for block in moved_back(self.field.blocks(wider), self._shift))

    def at(self, rows: AnyArray, columns: AnyArray) -> AnyArray:
        """Grey levels (frame, pixel) of single pixels."""
        return pixels_at(self.blocks, self.field.bands(), rows, columns)


class Sample(NamedTuple):
    """Some pixels that stand for a field."""

    field: FieldFrames
    steps: FloatArray
    """(frame) one step a frame, a start."""
    at: tuple[AnyArray, AnyArray]
    """Rows and columns (pixel)."""
    levels: AnyArray
    """(frame, pixel)"""
    slopes: Slopes

    @property
    def across(self) -> FloatArray:
        """(pixel,), slide coordinate u."""
        return across_image(self.field.shape[1])[self.at[1]]


class SolvedField(NamedTuple):
    """The steps of one field, and what its maps are made from."""

    steps: StepField
    frames: Steadied
    at: tuple[AnyArray, AnyArray]
    """Rows and columns of the pixels that took part."""
    levels: AnyArray
    """(frame, pixel), theirs."""


def sampled(
    frames: FrameStack,
    first: int,
    steps: FloatArray,
    fields: list[slice],
    *,
    start: FringeMaps,
    labelled: BoolArray,
    params: PhaseParams,
    top_level: float,
) -> list[Sample]:
    """Well-lit pixels of each field among those ``labelled``; ``start`` are the linear maps.

    Raises
    ------
    CaptureProblem
        There are too few that the sensor does not clip.
    """
    count = len(steps)
    wanted = max(params.joint_pixels, min(ENOUGH_SAMPLES // count, MOST_PIXELS))
    steady = labelled & (start.phase_std < 4.0 * np.median(start.phase_std[labelled]))
    samples = []
    for field, own in _field_frames(frames, first, steps, fields):
        background, modulation, phase = (part[field.rows] for part in start[1:3] + start[:1])
        unclipped = background + modulation < top_level
        at = evenly_spread(steady[field.rows] & unclipped, min(wanted, max(MOST_SAMPLES // count, FEWEST_PIXELS)))
        if len(at[0]) < FEWEST_PIXELS:
            raise CaptureProblem(
                "exposure",
                "unclipped_pixels",
                "Almost all that the stripes reach is too bright for the camera: close the lens's aperture or shorten "
                "the exposure.",
                value=len(at[0]),
                limit=FEWEST_PIXELS,
                unit="pixel",
            )
        samples.append(Sample(field, own, at, field.at(*at), slopes_at(background, modulation, phase, at)))
    return samples


def joint_steps(samples: list[Sample], unwrapped: Float32Array, *, held: BoolArray) -> list[SolvedField]:
    """Steps that vary over the field, solved jointly with the phase of some pixels; each field has its own.

    ``unwrapped`` (y, x) is the roughly known unwrapped phase, right at the samples; ``held`` (frame,) says which frames
    show the slide at its reference position.
    """
    solved = []
    for own in samples:
        rough = unwrapped[own.field.rows][own.at].astype(float)
        found = solve_scan_steps(own.levels, rough, own.across, own.steps, held, own.slopes)
        steadied = Steadied(own.field, found.shift)
        levels = steadied.at(*own.at) if found.shift.any() else own.levels
        solved.append(SolvedField(found.moved_back(own.slopes.carrier), steadied, own.at, levels))
    return solved


def joint_maps(solved: list[SolvedField], unwrapped: Float32Array, *, top_level: float) -> tuple[FringeMaps, float]:
    """Fringe maps at the steps solved; ``unwrapped`` as for :func:`joint_steps`.

    The second is by how much errors that last over several frames, as video compression makes them, enlarge the phase's
    standard deviation.
    """
    parts, lasting = [], 1.0
    for own in solved:
        rows = own.frames.field.rows
        maps = solve_phase_field(
            own.frames.blocks, unwrapped[rows], own.steps, top_level=top_level, bands=own.frames.field.bands()
        )
        sample = FringeMaps(*(part[own.at] for part in maps))
        inflation = _inflation(own, unwrapped[rows][own.at], sample)
        maps.phase_std[:] *= np.float32(inflation)
        _add_gain_doubt(maps, own.steps)
        lasting = max(lasting, inflation)
        parts.append((rows, maps))
    return _woven(parts, unwrapped.shape), lasting


def _field_frames(
    frames: FrameStack, first: int, steps: FloatArray, fields: list[slice]
) -> Iterator[tuple[FieldFrames, FloatArray]]:
    """Each field with its own steps: it is exposed a part of a frame later than the one before."""
    moments = np.arange(len(steps))
    for number, rows in enumerate(fields):
        own = np.interp(moments + number / len(fields), moments, steps)
        yield FieldFrames(frames, first, first + len(own), rows), own


def _woven(parts: list[tuple[slice, FringeMaps]], shape: tuple[int, ...]) -> FringeMaps:
    """The maps (y, x) of the whole image from those of its fields' rows."""
    if len(parts) == 1:
        return parts[0][1]
    woven = FringeMaps(*(np.empty(shape, np.float32) for _ in FringeMaps._fields))
    for rows, maps in parts:
        for target, part in zip(woven, maps, strict=True):
            target[rows] = part
    return woven


def _linear_field(field_frames: FieldFrames, steps: FloatArray, params: PhaseParams) -> FringeMaps:
    weights, used = _weights(steps, params)
    own = field_frames._replace(end=field_frames.first + len(used))
    maps = FringeMaps(*(np.empty(own.shape, np.float32) for _ in FringeMaps._fields))
    for band in own.bands():
        sums = HarmonicSums((band.stop - band.start, own.shape[1]), used, weights)
        for block in own.blocks(band):
            sums.add(block)
        for target, part in zip(maps, sums.maps(), strict=True):
            target[band] = part
    return maps


def _add_gain_doubt(maps: FringeMaps, field: StepField) -> None:
    """Add to the phase's standard deviation what the gain may hide.

    A gain that goes with the step's cosine or sine is a warped step, as far as the frames can tell; of a gain that
    scatters by s over N frames these courses hold some s·√(2/N), and the phase is off by that times a/b.
    """
    frames = np.arange(len(field.gain))
    scatter = float(np.std(field.gain - np.polyval(np.polyfit(frames, field.gain, 1), frames)))
    doubt = np.float32(scatter * np.sqrt(2.0 / len(frames)))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(maps.modulation > 0, maps.background / maps.modulation, 0.0)
    np.hypot(maps.phase_std, doubt * share, out=maps.phase_std)


def _inflation(own: SolvedField, unwrapped: Float32Array, sample: FringeMaps) -> float:
    """What compression's lasting errors make of the phase's standard deviation, from the pixels that took part."""
    across = across_image(own.frames.field.shape[1])[own.at[1]]
    fit = fit_pixels(
        levelled(own.levels.astype(np.float32), own.steps),
        sample.wrapped_phase,
        own.steps.steps_at(unwrapped, across).astype(np.float32),
        own.steps.waveform.at(sample.background, sample.modulation),
    )
    return float(phase_std_inflation(fit.residual, fit.value, fit.slope) ** LASTING_POWER)


def _weights(steps: FloatArray, params: PhaseParams) -> tuple[FloatArray, FloatArray]:
    """Weights per frame and the steps of the frames they cover."""
    try:
        if params.method == "thesis":
            weights, used = weights_of_even_resampling(steps)
            count = int(np.flatnonzero(used)[-1]) + 1
            return weights[:, :count], steps[:count]
        return weights_of_least_squares(steps), steps
    except ValueError as error:
        raise CaptureProblem(
            "timeline",
            "periods",
            f"The crank moved the stripes too little for a phase ({error}): turn it from stop to stop.",
            value=float(np.ptp(steps) / (2 * np.pi)),
            limit=1.0 if params.method == "thesis" else 0.9,
            unit="period",
        ) from None
