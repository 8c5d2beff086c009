"""Phase of the whole field at steps that vary over it: two passes over the frames, bounded memory.

Each pixel's frames are fitted with a + c·cos δ + s·sin δ + (known harmonics), δ_pn from the pixel's own slide
coordinate. The second pass knows the first one's solution: it adds the harmonics of the waveform and leaves out frames
that do not follow the model (the pattern's edge has crossed the pixel, a shadow, a hand).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numba
import numpy as np

from rahas.kernels.joint_steps import HARMONICS, StepField
from rahas.kernels.lit_spans import solve_lit_spans
from rahas.kernels.normal_sums import SUMS, Solution, solve_sums
from rahas.kernels.phase_shifting import FringeMaps, wrap
from rahas.typing import AnyArray, Float32Array, FloatArray

TABLE_SIZE = 8192
MIN_ARC = 0.75 * 2.0 * np.pi  # radians; less of a period does not hold a phase
REJECT_SIGMAS = 5.0
REJECT_MODULATION = 0.2
CROSSED = 2.5  # a pixel whose residual is so many times its neighbours' does not follow the model
QUANTISATION = 0.3  # grey levels


def solve_phase_field(
    read_blocks: Callable[[], Iterable[AnyArray]], unwrapped: AnyArray, field: StepField
) -> FringeMaps:
    """Fringe maps of the whole field; nothing is said (modulation 0) of a pixel that saw too short an arc.

    Parameters
    ----------
    read_blocks
        Gives the frames of ``field``, in order, in blocks (n, y, x); called twice.
    unwrapped
        (y, x), radians, roughly known unwrapped phase of every pixel (it says where in the slide the pixel lies).
    field
        The steps.

    Returns
    -------
    maps
        As from :class:`rahas.kernels.phase_shifting.HarmonicSums`.
    """
    basis = field.basis(unwrapped.reshape(-1)).astype(np.float32)
    table = np.cos(2.0 * np.pi * np.arange(TABLE_SIZE + 2) / TABLE_SIZE).astype(np.float32)
    per_frame = np.column_stack([field.coefficients, field.gain, field.offset]).astype(np.float32)
    kappa = np.array([[k.real, k.imag] for k in field.waveform], np.float32)
    solution, _ = _passage(read_blocks(), per_frame, basis, table, kappa, None)
    noise = _expected_noise(solution)
    crossed = np.flatnonzero(solution.noise > CROSSED * noise)
    series: list[AnyArray] = []
    solution, arc = _passage(_keeping(read_blocks(), crossed, series), per_frame, basis, table, kappa, solution)
    if len(crossed):
        spans = solve_lit_spans(
            (np.concatenate(series) - field.offset[:, None]) / field.gain[:, None],
            field.coefficients @ basis[:, crossed],
            noise[crossed],
            min_arc=MIN_ARC,
            tolerance=CROSSED,
        )
        for target, found in zip(solution, spans, strict=True):
            target[crossed] = found
        arc[crossed] = np.inf
    solution.cosine[arc < MIN_ARC] = 0.0
    solution.sine[arc < MIN_ARC] = 0.0
    return _maps(solution, unwrapped.shape)


def _passage(
    blocks: Iterable[AnyArray],
    per_frame: Float32Array,
    basis: Float32Array,
    table: Float32Array,
    kappa: Float32Array,
    former: Solution | None,
) -> tuple[Solution, Float32Array]:
    """One pass over the frames: the solution, and the arc (pixel,) in radians that its frames span."""
    pixels = basis.shape[1]
    sums = np.zeros((pixels, SUMS), np.float32)
    arc = np.empty((pixels, 2), np.float32)
    arc[:, 0], arc[:, 1] = np.inf, -np.inf
    base = np.zeros(pixels, np.float32)  # taken off before summing: single precision then suffices
    known = np.zeros((pixels, 4), np.float32)
    if former is not None:
        known[:] = np.stack([former.background, former.cosine, former.sine, former.noise], axis=1)
    start = 0
    for block in blocks:
        levels = np.ascontiguousarray(block.reshape(len(block), -1))
        if start == 0:
            base[:] = levels[0]
        here = per_frame[start : start + len(block)]
        _accumulate(levels, here, basis, table, kappa, known, former is not None, base, sums, arc)
        start += len(block)
    solution = solve_sums(sums)
    return solution._replace(background=solution.background + base), arc[:, 1] - arc[:, 0]


def _keeping(blocks: Iterable[AnyArray], pixels: AnyArray, kept: list[AnyArray]) -> Iterator[AnyArray]:
    """Pass blocks on, keeping the frames of some pixels."""
    for block in blocks:
        if len(pixels):
            kept.append(block.reshape(len(block), -1)[:, pixels])
        yield block


def _expected_noise(solution: Solution) -> FloatArray:
    """Residual that a pixel in the light has, from the field's own pixels of like brightness. (pixel,), grey levels."""
    known = np.isfinite(solution.noise) & (np.hypot(solution.cosine, solution.sine) > 3.0 * QUANTISATION)
    expected = np.full(len(solution.noise), np.inf)
    if known.sum() < 100:
        return expected
    edges = np.quantile(solution.background[known], np.linspace(0.0, 1.0, 9))
    bins = np.clip(np.searchsorted(edges, solution.background) - 1, 0, 7)
    for b in range(8):
        members = known & (bins == b)
        if members.any():
            expected[bins == b] = max(QUANTISATION, float(np.median(solution.noise[members])))
    return expected


def _maps(solution: Solution, shape: tuple[int, ...]) -> FringeMaps:
    modulation = np.hypot(solution.cosine, solution.sine)
    with np.errstate(divide="ignore", invalid="ignore"):
        phase_std = np.where(modulation > 0, solution.noise * solution.spread / modulation, np.inf)
    wrapped = wrap(np.arctan2(-solution.sine, solution.cosine))
    return FringeMaps(
        *(
            np.ascontiguousarray(m.reshape(shape), dtype=np.float32)
            for m in (wrapped, solution.background, modulation, phase_std, solution.noise)
        )
    )


@numba.njit(cache=True, fastmath=True)
def _accumulate(pixels, per_frame, basis, table, kappa, solution, refine, base, sums, arc):  # type: ignore[no-untyped-def]
    frames, count = pixels.shape
    scale = np.float32(TABLE_SIZE / (2.0 * np.pi))
    quarter = TABLE_SIZE // 4
    mask = TABLE_SIZE - 1
    for n in range(frames):
        k0, k1, k2, offset = per_frame[n, 0], per_frame[n, 1], per_frame[n, 2], per_frame[n, 4]
        lift = np.float32(1.0) / per_frame[n, 3]
        for p in range(count):
            level = (np.float32(pixels[n, p]) - offset) * lift
            delta = k0 * basis[0, p] + k1 * basis[1, p] + k2 * basis[2, p]
            place = delta * scale
            low = np.floor(place)
            part = place - low
            index = np.int64(low)
            at = index & mask
            cosine = table[at] + part * (table[at + 1] - table[at])
            at = (index - quarter) & mask  # sin t = cos(t − π/2)
            sine = table[at] + part * (table[at + 1] - table[at])
            if refine:
                a, c, s, sigma = solution[p, 0], solution[p, 1], solution[p, 2], solution[p, 3]
                modulation = np.sqrt(c * c + s * s)
                if modulation > 0:
                    # e^{i(φ+δ)} from the first pass: cos = (c cos δ + s sin δ)/b, sin = (c sin δ − s cos δ)/b
                    co = (c * cosine + s * sine) / modulation
                    si = (c * sine - s * cosine) / modulation
                    c2, s2 = co * co - si * si, np.float32(2.0) * co * si
                    c3, s3 = c2 * co - s2 * si, s2 * co + c2 * si
                    level -= modulation * (kappa[0, 0] * c2 - kappa[0, 1] * s2 + kappa[1, 0] * c3 - kappa[1, 1] * s3)
                    off = level - a - modulation * co
                    if abs(off) > REJECT_SIGMAS * sigma + REJECT_MODULATION * modulation:
                        continue
            level -= base[p]
            sums[p, 0] += 1.0
            sums[p, 1] += cosine
            sums[p, 2] += sine
            sums[p, 3] += cosine * cosine
            sums[p, 4] += cosine * sine
            sums[p, 5] += sine * sine
            sums[p, 6] += level
            sums[p, 7] += level * cosine
            sums[p, 8] += level * sine
            sums[p, 9] += level * level
            if delta < arc[p, 0]:
                arc[p, 0] = delta
            if delta > arc[p, 1]:
                arc[p, 1] = delta


assert HARMONICS == (2, 3)  # the loop above spells them out
