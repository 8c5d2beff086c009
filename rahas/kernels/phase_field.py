"""Phase of the whole field at steps that vary over it: two passes over the frames, bounded memory.

Each pixel's frames are fitted with a + c·cos δ + s·sin δ + (known harmonics), δ_pn from the pixel's own slide
coordinate. The second pass knows the first one's solution: it adds the harmonics of the waveform and leaves out frames
that do not follow the model (the pattern's edge has crossed the pixel, a shadow, a hand).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numba
import numpy as np

from rahas.kernels.joint_steps import HARMONICS, StepField
from rahas.kernels.phase_shifting import FringeMaps, wrap
from rahas.typing import AnyArray, Float32Array, FloatArray

TABLE_SIZE = 8192
MIN_ARC = 0.75 * 2.0 * np.pi  # radians; less of a period does not hold a phase
REJECT_SIGMAS = 5.0
REJECT_MODULATION = 0.2
SUMS = 10  # 1, c, s, cc, cs, ss, I, Ic, Is, II


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
    table = np.cos(2.0 * np.pi * np.arange(TABLE_SIZE + TABLE_SIZE // 4 + 2) / TABLE_SIZE).astype(np.float32)
    coefficients = field.coefficients.astype(np.float32)
    kappa = np.array([[k.real, k.imag] for k in field.waveform], np.float32)
    solution = np.zeros((unwrapped.size, 4), np.float32)  # a, c, s, σ
    for passage in range(2):
        sums = np.zeros((unwrapped.size, SUMS), np.float32)
        spread = np.empty((unwrapped.size, 2), np.float32)
        spread[:, 0], spread[:, 1] = np.inf, -np.inf
        start = 0
        for block in read_blocks():
            pixels = np.ascontiguousarray(block.reshape(len(block), -1))
            here = coefficients[start : start + len(block)]
            _accumulate(pixels, here, basis, table, kappa, solution, passage == 1, sums, spread)
            start += len(block)
        solution, variance = _solved(sums)
    solution[spread[:, 1] - spread[:, 0] < MIN_ARC, 1:3] = 0.0
    return _maps(solution, variance, unwrapped.shape)


def _solved(sums: Float32Array) -> tuple[Float32Array, FloatArray]:
    """Solve each pixel's 3 × 3 normal equations; columns a, c, s, σ, and var φ·b²/σ² as the last result."""
    one, c, s, cc, cs, ss, i, ic, is_, ii = (sums[:, k].astype(np.float64) for k in range(SUMS))
    one = np.maximum(one, 1.0)
    # means removed: two unknowns are left
    cc, cs, ss = cc - c * c / one, cs - c * s / one, ss - s * s / one
    ic, is_ = ic - c * i / one, is_ - s * i / one
    determinant = cc * ss - cs * cs
    good = determinant > 1e-3 * one * one
    safe = np.where(good, determinant, 1.0)
    cosine = np.where(good, (ss * ic - cs * is_) / safe, 0.0)
    sine = np.where(good, (cc * is_ - cs * ic) / safe, 0.0)
    level = (i - cosine * c - sine * s) / one
    left = ii - i * i / one - cosine * ic - sine * is_
    sigma = np.sqrt(np.maximum(left, 0.0) / np.maximum(one - 3.0, 1.0))
    square = np.maximum(cosine**2 + sine**2, 1e-9)
    # variance of the angle of (c, −s): the inverse normal matrix across the phasor
    factor = (sine**2 * ss + cosine**2 * cc + 2.0 * sine * cosine * cs) / (safe * square)
    solution = np.stack([level, cosine, sine, np.where(good, sigma, np.inf)], axis=1).astype(np.float32)
    return solution, np.where(good, factor, np.inf)


def _maps(solution: Float32Array, factor: FloatArray, shape: tuple[int, ...]) -> FringeMaps:
    background, cosine, sine, sigma = solution.T
    modulation = np.hypot(cosine, sine)
    with np.errstate(divide="ignore", invalid="ignore"):
        phase_std = sigma * np.sqrt(factor) / modulation
    return FringeMaps(
        *(
            np.ascontiguousarray(m.reshape(shape), dtype=np.float32)
            for m in (wrap(np.arctan2(-sine, cosine)), background, modulation, phase_std, sigma)
        )
    )


@numba.njit(cache=True, fastmath=True)
def _accumulate(pixels, coefficients, basis, table, kappa, solution, refine, sums, spread):  # type: ignore[no-untyped-def]
    frames, count = pixels.shape
    scale = np.float32(TABLE_SIZE / (2.0 * np.pi))
    quarter = TABLE_SIZE // 4
    mask = TABLE_SIZE - 1
    for n in range(frames):
        k0, k1, k2 = coefficients[n, 0], coefficients[n, 1], coefficients[n, 2]
        for p in range(count):
            level = np.float32(pixels[n, p])
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
            if delta < spread[p, 0]:
                spread[p, 0] = delta
            if delta > spread[p, 1]:
                spread[p, 1] = delta


assert HARMONICS == (2, 3)  # the loop above spells them out
