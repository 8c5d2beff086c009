"""Phase of the whole field at steps that vary over it: two passes over the frames, bounded memory.

The first pass fits a cosine to each pixel's frames. The second is a Gauss–Newton step from there with the waveform that
belongs to the pixel's brightness; it leaves out frames that do not follow (a shadow, a hand, the sensor's limit).
Pixels that the pattern's edge crosses are fitted apart, on the frames in which they are lit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rahas.kernels.field_sums import add_linear, add_refined
from rahas.kernels.joint_steps import StepField, across_image
from rahas.kernels.lit_spans import lit_spans
from rahas.kernels.normal_sums import PART, SUMS, solve_sums
from rahas.kernels.phase_shifting import FringeMaps, wrap
from rahas.kernels.pixel_fit import fit_pixels
from rahas.typing import AnyArray, Float32Array, FloatArray

TURN = 2.0 * np.pi
MIN_ARC = 0.75 * TURN  # radians; less of a period does not hold a phase
REJECT_SIGMAS = 5.0
REJECT_MODULATION = 0.2
CROSSED = 2.5  # a pixel whose residual is so many times its neighbours' does not follow the model
QUANTISATION = 0.3  # grey levels
STRONG = 0.05  # a harmonic beyond which the cosine that begins is too far off for one Gauss–Newton step
NOISE_BINS = 8
LEAST_KNOWN = 100  # pixels
KEPT_SAMPLES = 20_000_000  # pixels times frames of a band kept for those fitted apart
CHUNK_SAMPLES = 400_000  # of these fitted at a time

ReadBlocks = Callable[[slice], Iterable[AnyArray]]


class _Fit(NamedTuple):
    """Each (pixel,)."""

    phase: FloatArray
    background: FloatArray
    modulation: FloatArray
    noise: FloatArray
    phase_std: FloatArray


class NoiseOfLight(NamedTuple):
    """Residual that a pixel in the light has, from pixels of like brightness."""

    edges: FloatArray  # (bin + 1,), grey levels of background; empty: too few pixels were measured to tell
    noise: Float32Array  # (bin,), grey levels

    def at(self, background: AnyArray) -> Float32Array:
        """Grey levels, any shape; infinite where nothing is known."""
        if not len(self.edges):
            return np.full(background.shape, np.inf, np.float32)
        return self.noise[np.searchsorted(self.edges[1:-1], background)]


def solve_phase_field(
    read_blocks: ReadBlocks,
    unwrapped: AnyArray,
    field: StepField,
    *,
    top_level: float = np.inf,
    bands: Sequence[slice] = (slice(None),),
) -> FringeMaps:
    """Fringe maps of the whole field; nothing is said (modulation 0) of a pixel that saw too short an arc.

    Parameters
    ----------
    read_blocks
        Gives some rows (a slice) of the frames of ``field``, in order, in blocks (n, y, x); called twice for each
        band, and more often where many pixels have to be fitted apart.
    unwrapped
        (y, x), radians, roughly known unwrapped phase of every pixel (it says where in the slide the pixel lies).
    field
        The steps.
    top_level
        Grey level from which on the sensor is saturated: such frames of a pixel are left out.
    bands
        Rows that are solved at a time, together the whole field: what they take bounds the memory.

    Returns
    -------
    maps
        As from :class:`rahas.kernels.phase_shifting.HarmonicSums`.
    """
    per_frame = np.vstack([field.coefficients.T / TURN, 1.0 / field.gain, field.offset]).astype(np.float32)
    top = np.float32(top_level)
    maps = FringeMaps(*(np.empty(unwrapped.shape, np.float32) for _ in FringeMaps._fields))
    for rows in bands:
        basis = _basis(field, unwrapped[rows])
        _put(maps, rows, _first_pass(read_blocks(rows), per_frame, basis, top))
    noise = noise_of_light(maps.background, maps.modulation, maps.residual_std)
    for rows in bands:
        basis, start = _basis(field, unwrapped[rows]), _taken(maps, rows)
        crossed = np.flatnonzero(start.noise > CROSSED * noise.at(start.background))
        kept: list[AnyArray] = []
        if len(crossed) * len(field.gain) <= KEPT_SAMPLES:
            fit = _second_pass(_keeping(read_blocks(rows), crossed, kept), per_frame, basis, top, start, field)
        else:
            fit = _second_pass(read_blocks(rows), per_frame, basis, top, start, field)
        if np.abs(field.waveform.constant).max() > STRONG:
            fit = _second_pass(read_blocks(rows), per_frame, basis, top, fit, field)
        size = max(1, KEPT_SAMPLES // len(field.gain))
        for part in (crossed[first : first + size] for first in range(0, len(crossed), size)):
            if not kept:
                for _ in _keeping(read_blocks(rows), part, kept):
                    pass
            apart = _fit_crossed(np.concatenate(kept), part, basis, start, noise, field)
            kept.clear()
            for target, found in zip(fit, apart, strict=True):
                target[part] = found
        _put(maps, rows, fit._replace(phase=wrap(fit.phase)))
    return maps


def _basis(field: StepField, unwrapped: AnyArray) -> Float32Array:
    basis = field.basis(unwrapped, across_image(unwrapped.shape[1]))
    return np.asarray(basis.reshape(len(basis), -1), np.float32)


def _put(maps: FringeMaps, rows: slice, fit: _Fit) -> None:
    """Write a band's fit into the maps of the field."""
    parts = (fit.phase, fit.background, fit.modulation, fit.phase_std, fit.noise)
    for target, part in zip(maps, parts, strict=True):
        target[rows] = part.reshape(target[rows].shape)


def _taken(maps: FringeMaps, rows: slice) -> _Fit:
    """What :func:`_put` wrote."""
    phase, background, modulation, phase_std, noise = (part[rows].reshape(-1) for part in maps)
    return _Fit(phase, background, modulation, noise, phase_std)


def _blocks_of_levels(blocks: Iterable[AnyArray], per_frame: Float32Array) -> Iterator[tuple[AnyArray, Float32Array]]:
    """Each block as (frame, pixel) with the columns of its frames."""
    start = 0
    for block in blocks:
        columns = np.ascontiguousarray(per_frame[:, start : start + len(block)])
        yield np.ascontiguousarray(block.reshape(len(block), -1)), columns
        start += len(block)


def _first_pass(blocks: Iterable[AnyArray], per_frame: Float32Array, basis: Float32Array, top: np.float32) -> _Fit:
    sums = np.zeros((basis.shape[1], SUMS + 1), np.float32)
    for number, (levels, columns) in enumerate(_blocks_of_levels(blocks, per_frame)):
        if number == 0:
            sums[:, SUMS] = levels[0]  # taken off before summing: single precision then suffices
        add_linear(levels, columns, basis, top, sums)
    found = solve_sums(sums)
    phase = np.arctan2(-found.second, found.first)
    unknown = np.full_like(phase, np.inf)
    return _Fit(phase, found.level + sums[:, SUMS], np.hypot(found.first, found.second), found.noise, unknown)


def _second_pass(
    blocks: Iterable[AnyArray],
    per_frame: Float32Array,
    basis: Float32Array,
    top: np.float32,
    start: _Fit,
    field: StepField,
) -> _Fit:
    pixels = basis.shape[1]
    limit = REJECT_SIGMAS * np.minimum(start.noise, 2.0 * field.noise) + REJECT_MODULATION * start.modulation
    known = np.empty((pixels, 5), np.float32)
    for column, values in enumerate(
        (start.background, start.modulation, np.cos(start.phase), np.sin(start.phase), limit)
    ):
        known[:, column] = values
    parts = np.empty((2 * len(field.waveform.constant), pixels), np.float32)
    for first in range(0, pixels, PART):
        part = slice(first, first + PART)
        kappa = field.waveform.at(start.background[part], start.modulation[part])
        parts[:, part] = np.concatenate([kappa.real, kappa.imag])
    sums = np.zeros((pixels, SUMS), np.float32)
    arc = np.empty((pixels, 2), np.float32)
    arc[:] = np.inf, -np.inf
    for levels, columns in _blocks_of_levels(blocks, per_frame):
        add_refined(levels, columns, basis, top, known, parts, sums, arc)
    found = solve_sums(sums)
    held = (arc[:, 1] - arc[:, 0]) * TURN >= MIN_ARC
    modulation = np.where(held, np.hypot(start.modulation + found.first, found.second), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        phase_std = np.where(modulation > 0, found.noise * np.sqrt(found.second_variance) / modulation, np.inf)
    turned = np.arctan2(found.second, start.modulation + found.first)
    return _Fit(start.phase + turned, start.background + found.level, modulation, found.noise, phase_std)


def _fit_crossed(
    levels: AnyArray, pixels: AnyArray, basis: Float32Array, start: _Fit, noise: NoiseOfLight, field: StepField
) -> _Fit:
    """Pixels of a band, levels (frame, pixel) as shot, that are lit in some of the frames only."""
    size = max(1, CHUNK_SAMPLES // len(levels))
    fits = []
    for first in range(0, len(pixels), size):
        own = pixels[first : first + size]
        seen = (levels[:, first : first + size] - field.offset[:, None]) / field.gain[:, None]
        delta = field.coefficients @ basis[:, own]
        kappa = field.waveform.at(start.background[own], start.modulation[own])
        fits.append(_fit_lit(seen, delta, kappa, noise.at(start.background[own])))
    return _Fit(*(np.concatenate(column) for column in zip(*fits, strict=True)))


def _fit_lit(levels: FloatArray, delta: FloatArray, kappa: AnyArray, noise: FloatArray) -> _Fit:
    """Pixels (frame, pixel) that are lit in some of the frames only."""
    used, phase = lit_spans(levels, delta, noise, min_arc=MIN_ARC, tolerance=CROSSED)
    own = fit_pixels(levels, phase, delta, kappa, used=used)
    frames = used.sum(axis=0)
    lit = (frames > 3) & (own.modulation > 0)
    left = np.sqrt(np.sum(own.residual**2, axis=0) / np.maximum(frames - 3, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        phase_std = np.where(lit, left * np.sqrt(own.phase_variance), np.inf)
    return _Fit(own.phase, own.background, np.where(lit, own.modulation, 0.0), left, phase_std)


def _keeping(blocks: Iterable[AnyArray], pixels: AnyArray, kept: list[AnyArray]) -> Iterator[AnyArray]:
    """Pass blocks on, keeping the frames of some pixels."""
    for block in blocks:
        if len(pixels):
            kept.append(block.reshape(len(block), -1)[:, pixels])
        yield block


def noise_of_light(background: AnyArray, modulation: AnyArray, noise: AnyArray) -> NoiseOfLight:
    """Typical residual ``noise`` of pixels by their background; grey levels, any shape."""
    known = np.isfinite(noise) & (modulation > 3.0 * QUANTISATION)
    if known.sum() < LEAST_KNOWN:
        return NoiseOfLight(np.empty(0), np.empty(0, np.float32))
    levels, own = background[known], noise[known]
    edges = np.quantile(levels, np.linspace(0.0, 1.0, NOISE_BINS + 1))
    bins = np.searchsorted(edges[1:-1], levels).astype(np.int8)
    typical = np.full(NOISE_BINS, np.inf, np.float32)
    for b in range(NOISE_BINS):
        members = own[bins == b]
        if len(members):
            typical[b] = max(QUANTISATION, float(np.median(members)))
    return NoiseOfLight(edges, typical)
