"""The two loops over all pixels and frames, written so that they run on the processor's vector units.

Both add up the sums of :mod:`rahas.kernels.normal_sums`, pixel by pixel, along the frames of a block. Angles are in
turns; their cosine and sine are polynomials, right to 1e-6.
"""

from __future__ import annotations

import numba
import numpy as np

from rahas.kernels.waveform import HARMONICS

TILE = 256  # pixels whose frames are brought together in the cache


@numba.njit(inline="always")
def _cosine_and_sine(turns):  # type: ignore[no-untyped-def]
    """cos 2πt and sin 2πt, from the Taylor series of half the angle."""
    x = np.float32(np.pi) * (turns - np.floor(turns + np.float32(0.5)))  # −π/2 … π/2
    square = x * x
    s = np.float32(-2.3889859e-08)
    s = s * square + np.float32(2.7525562e-06)
    s = s * square - np.float32(1.9840874e-04)
    s = s * square + np.float32(8.3333310e-03)
    s = s * square - np.float32(1.6666667e-01)
    half_sine = x + x * square * s
    c = np.float32(2.0875723e-09)
    c = c * square - np.float32(2.7557319e-07)
    c = c * square + np.float32(2.4801587e-05)
    c = c * square - np.float32(1.3888889e-03)
    c = c * square + np.float32(4.1666667e-02)
    c = c * square - np.float32(0.5)
    half_cosine = np.float32(1.0) + square * c
    two = np.float32(2.0)
    return np.float32(1.0) - two * half_sine * half_sine, two * half_sine * half_cosine


@numba.njit(cache=True, fastmath=True, nogil=True)
def add_linear(levels, per_frame, basis, top, sums):  # type: ignore[no-untyped-def]
    """Add frames to the sums of the fit a + c·cos δ + s·sin δ to each pixel's levels over ``sums[p, 10]``.

    levels (frame, pixel); per_frame (5, frame): step coefficients in turns, 1/gain, offset; basis (3, pixel); top: grey
    level from which on a frame of a pixel is left out; sums (pixel, SUMS + 1), whose last column is taken off first.
    """
    frames, count = levels.shape
    one, zero = np.float32(1.0), np.float32(0.0)
    series = np.empty((TILE, frames), np.float32)
    for start in range(0, count, TILE):
        size = min(TILE, count - start)
        for n in range(frames):
            for q in range(size):
                series[q, n] = levels[n, start + q]
        for q in range(size):
            p = start + q
            base, b0, b1, b2 = sums[p, 10], basis[0, p], basis[1, p], basis[2, p]
            sw = sc = ss = scc = scs = sss = si = sic = sis = sii = zero
            for n in range(frames):
                seen = series[q, n]
                used = one if seen < top else zero
                level = used * ((seen - per_frame[4, n]) * per_frame[3, n] - base)
                turns = per_frame[0, n] * b0 + per_frame[1, n] * b1 + per_frame[2, n] * b2
                cosine, sine = _cosine_and_sine(turns)
                c, s = used * cosine, used * sine
                sw += used
                sc += c
                ss += s
                scc += c * c
                scs += c * s
                sss += s * s
                si += level
                sic += level * c
                sis += level * s
                sii += level * level
            for k, value in enumerate((sw, sc, ss, scc, scs, sss, si, sic, sis, sii)):
                sums[p, k] += value


@numba.njit(cache=True, fastmath=True, nogil=True)
def add_refined(levels, per_frame, basis, top, known, kappa, sums, arc):  # type: ignore[no-untyped-def]
    """Add frames to the sums of the fit da + x·w + y·w′ to what a known solution leaves.

    known (pixel, 5): a, b, cos φ, sin φ and the residual from which on a frame is left out; kappa (10, pixel):
    real, then imaginary parts of κ_2 … κ_6; arc (pixel, 2): least and greatest step of the frames used, turns.
    """
    frames, count = levels.shape
    zero, one, two, three = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(3.0)
    four, five, six = np.float32(4.0), np.float32(5.0), np.float32(6.0)
    series = np.empty((TILE, frames), np.float32)
    kept, place = np.empty(frames, np.float32), np.empty(frames, np.float32)
    for start in range(0, count, TILE):
        size = min(TILE, count - start)
        for n in range(frames):
            for q in range(size):
                series[q, n] = levels[n, start + q]
        for q in range(size):
            p = start + q
            b0, b1, b2 = basis[0, p], basis[1, p], basis[2, p]
            a, b, cos_phi, sin_phi, limit = known[p, 0], known[p, 1], known[p, 2], known[p, 3], known[p, 4]
            r2, r3, r4, r5, r6 = kappa[0, p], kappa[1, p], kappa[2, p], kappa[3, p], kappa[4, p]
            i2, i3, i4, i5, i6 = kappa[5, p], kappa[6, p], kappa[7, p], kappa[8, p], kappa[9, p]
            sw = sc = ss = scc = scs = sss = si = sic = sis = sii = zero
            least, most = arc[p, 0], arc[p, 1]
            for n in range(frames):
                seen = series[q, n]
                turns = per_frame[0, n] * b0 + per_frame[1, n] * b1 + per_frame[2, n] * b2
                cosine, sine = _cosine_and_sine(turns)
                c1, s1 = cosine * cos_phi - sine * sin_phi, sine * cos_phi + cosine * sin_phi
                c2, s2 = c1 * c1 - s1 * s1, two * c1 * s1
                c3, s3 = c2 * c1 - s2 * s1, s2 * c1 + c2 * s1
                c4, s4 = c2 * c2 - s2 * s2, two * c2 * s2
                c5, s5 = c3 * c2 - s3 * s2, s3 * c2 + c3 * s2
                c6, s6 = c3 * c3 - s3 * s3, two * c3 * s3
                w = c1 + r2 * c2 + r3 * c3 + r4 * c4 + r5 * c5 + r6 * c6
                w -= i2 * s2 + i3 * s3 + i4 * s4 + i5 * s5 + i6 * s6
                d = -s1 - two * (r2 * s2 + i2 * c2) - three * (r3 * s3 + i3 * c3) - four * (r4 * s4 + i4 * c4)
                d -= five * (r5 * s5 + i5 * c5) + six * (r6 * s6 + i6 * c6)
                left = (seen - per_frame[4, n]) * per_frame[3, n] - a - b * w
                used = (one if seen < top else zero) * (one if abs(left) <= limit else zero)
                w, d, left = used * w, used * d, used * left
                sw += used
                sc += w
                ss += d
                scc += w * w
                scs += w * d
                sss += d * d
                si += left
                sic += left * w
                sis += left * d
                sii += left * left
                kept[n] = used
                place[n] = turns
            for n in range(frames):
                if kept[n] > zero:
                    least, most = min(least, place[n]), max(most, place[n])
            arc[p, 0], arc[p, 1] = least, most
            for k, value in enumerate((sw, sc, ss, scc, scs, sss, si, sic, sis, sii)):
                sums[p, k] += value


assert HARMONICS == (2, 3, 4, 5, 6)  # the loop above spells them out
