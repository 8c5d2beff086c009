"""Phase steps that vary over the field, solved jointly with the phase of some thousands of pixels.

The crank of this scanner tilts the projector, so one frame's step is not one number: it varies smoothly with the
slide coordinate v, that is with the unwrapped phase itself (never with the place in the image, where depth steps would
break it). Per frame n and pixel p

    I_pn = g_n·(a_p + b_p·w(φ_p + δ_pn)) + o_n,    δ_pn = Σ_k C_nk·P_k(v_p),    w(t) = cos t + Σ_h Re(κ_h e^{iht}),

with Legendre polynomials P_0…P_2 and C free per frame, so that a tilting projector, a translated slide and a pivot
beside the projection centre are all in it, and stalls, slips and repeated frames are harmless. The waveform κ is one
for all pixels and locked to the pattern. Gauss–Newton over {C, g, o, κ}; the pixels' own (a, b, φ) are eliminated
(Schur complement). The steps of frames in the hold before the scan are zero: that fixes the gauge. Gain and offset
(auto-exposure, flicker, ambient drift) have priors around 1 and 0 as wide as they turn out to scatter, for a gain that
ripples with the step is hard to tell from a warped step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray, BoolArray, FloatArray

DEGREE = 2
HARMONICS = (2, 3)
OUTLIER_SIGMAS = 5.0
PRIOR_START = 0.03  # standard deviation of the gain, and of the offset over the median background
PRIOR_LEAST = 2e-4


class StepField(NamedTuple):
    """The phase step of every frame as a function of unwrapped phase, and the pattern's waveform."""

    coefficients: FloatArray  # (frame, DEGREE + 1), radians, of Legendre polynomials
    centre: float  # radians, unwrapped phase that maps to 0
    half_range: float  # radians, unwrapped phase range that maps to [−1, 1]
    gain: FloatArray  # (frame,), g, 1 on average
    offset: FloatArray  # (frame,), o, grey levels, 0 on average
    waveform: AnyArray  # (len(HARMONICS),) complex, κ_2, κ_3
    noise: float  # grey levels, robust standard deviation of the residuals
    inliers: float  # share of the pixels that follow the model in every frame
    last_change: float  # radians, largest change in the last iteration

    def steps_at(self, unwrapped: AnyArray) -> FloatArray:
        """Steps (frame, *shape of unwrapped), radians."""
        return np.tensordot(self.coefficients, self.basis(unwrapped), axes=1)

    def basis(self, unwrapped: AnyArray) -> FloatArray:
        """Legendre polynomials (DEGREE + 1, *shape), at unwrapped phases in radians."""
        scaled = (np.asarray(unwrapped, dtype=float) - self.centre) / self.half_range
        return np.moveaxis(np.polynomial.legendre.legvander(scaled, DEGREE), -1, 0)


def waveform_of(t: FloatArray, kappa: AnyArray) -> tuple[FloatArray, FloatArray]:
    """The waveform w and its derivative w′ at phases ``t`` in radians."""
    value, slope = np.cos(t), -np.sin(t)
    for harmonic, k in zip(HARMONICS, kappa, strict=True):
        cosine, sine = np.cos(harmonic * t), np.sin(harmonic * t)
        value = value + k.real * cosine - k.imag * sine
        slope = slope - harmonic * (k.real * sine + k.imag * cosine)
    return value, slope


def solve_joint_steps(
    levels: AnyArray, unwrapped: FloatArray, steps: FloatArray, held: BoolArray, *, iterations: int = 6
) -> StepField:
    """Refine the steps of all frames jointly, from pixels whose unwrapped phase is roughly known.

    Parameters
    ----------
    levels
        (frame, pixel), grey levels.
    unwrapped
        (pixel,), radians, right to some tenths of a radian.
    steps
        (frame,), radians, one number a frame, right to some tenths of a radian.
    held
        (frame,), frames whose step is zero by definition; at least one.
    iterations
        At most so many; it stops when no step changes by more than 0.5 mrad.

    Raises
    ------
    ValueError
        No held frame, or too few pixels for the unknowns.
    """
    levels = np.asarray(levels, dtype=np.float64)
    frames, pixels = levels.shape
    if not held.any() or pixels < 20 * (DEGREE + 1):
        raise ValueError(f"{held.sum() = }, {pixels = }: a held frame and {20 * (DEGREE + 1)} pixels are needed")
    centre = float(0.5 * (unwrapped.min() + unwrapped.max()))
    half_range = float(max(0.5 * np.ptp(unwrapped), np.pi))
    coefficients = np.zeros((frames, DEGREE + 1))
    coefficients[:, 0] = np.where(held, 0.0, steps)
    gain, offset = np.ones(frames), np.zeros(frames)
    kappa = np.zeros(len(HARMONICS), dtype=complex)
    phase = np.array(unwrapped, dtype=float)
    basis = np.polynomial.legendre.legvander((unwrapped - centre) / half_range, DEGREE)
    noise = inliers = last_change = np.nan
    for number in range(iterations):
        delta = coefficients @ basis.T
        own = _solve_pixels((levels - offset[:, None]) / gain[:, None], phase, delta, kappa)
        phase = own.phase
        noise = float(max(1.4826 * np.median(np.abs(own.residual)), 1e-3))
        good = (np.abs(own.residual) < OUTLIER_SIGMAS * noise).all(axis=0) & (own.modulation > 0)
        inliers = float(good.mean())
        if inliers < 0.3:  # still far away: the worst third waits for the next round
            worst = np.abs(own.residual).max(axis=0)
            good = worst <= np.quantile(worst, 0.67)
        own = own.only(good)
        jacobian = np.concatenate(
            [
                (own.modulation * own.slope)[..., None] * basis[good] * ~held[:, None, None],
                (own.background + own.modulation * own.value)[..., None],
                np.ones((*own.value.shape, 1)),
            ],
            axis=-1,
        )
        level = float(np.median(own.background))
        prior = np.array([np.std(gain), np.std(offset) / level]) if number else np.full(2, PRIOR_START)
        prior = np.maximum(prior, PRIOR_LEAST) * [1.0, level]
        weight = noise**2 / np.concatenate([np.full(DEGREE + 1, np.inf), prior**2])
        mean = np.stack([*[np.zeros(frames)] * (DEGREE + 1), gain - 1.0, offset], axis=1)
        harmonics = _harmonics(own.phase + delta[:, good], own.modulation)
        change, kappa_change = _gauss_newton(own, jacobian, harmonics, weight, mean)
        coefficients += change[:, : DEGREE + 1] * ~held[:, None]
        gain = gain * (1.0 + change[:, DEGREE + 1])
        offset = offset + gain * change[:, DEGREE + 2]
        gain, offset = gain / gain.mean(), offset - offset.mean()
        kappa = kappa + kappa_change
        last_change = float(np.abs(change[~held, : DEGREE + 1]).max()) if not held.all() else 0.0
        if last_change < 5e-4:
            break
    return StepField(coefficients, centre, half_range, gain, offset, kappa, noise, inliers, last_change)


class _Pixels(NamedTuple):
    """The pixels' own unknowns at known steps, and what they leave."""

    phase: FloatArray  # (pixel,)
    background: FloatArray  # (pixel,)
    modulation: FloatArray  # (pixel,)
    residual: FloatArray  # (frame, pixel)
    value: FloatArray  # (frame, pixel), w
    slope: FloatArray  # (frame, pixel), w′

    def only(self, good: BoolArray) -> _Pixels:
        return _Pixels(*(part[..., good] for part in self))


def _solve_pixels(levels: FloatArray, phase: FloatArray, delta: FloatArray, kappa: AnyArray) -> _Pixels:
    for _ in range(2):
        value, slope = waveform_of(phase + delta, kappa)
        background, modulation, turned = _three_unknowns(levels, value, slope)
        phase = phase + np.where(modulation > 0, np.arctan2(turned, modulation), 0.0)
    value, slope = waveform_of(phase + delta, kappa)
    background, modulation, _ = _three_unknowns(levels, value, slope)
    return _Pixels(phase, background, modulation, levels - background - modulation * value, value, slope)


def _three_unknowns(levels: FloatArray, value: FloatArray, slope: FloatArray) -> tuple[FloatArray, ...]:
    columns = (np.ones_like(value), value, slope)
    normal = np.empty((levels.shape[1], 3, 3))
    right = np.empty((levels.shape[1], 3))
    for i in range(3):
        right[:, i] = np.einsum("np,np->p", columns[i], levels)
        for j in range(i, 3):
            normal[:, i, j] = normal[:, j, i] = np.einsum("np,np->p", columns[i], columns[j])
    solution = np.linalg.solve(normal, right[..., None])[..., 0]
    return solution[:, 0], solution[:, 1], solution[:, 2]


def _harmonics(t: FloatArray, modulation: FloatArray) -> FloatArray:
    """Derivatives of the frames by Re and Im of each κ: (frame, pixel, 2·harmonics)."""
    parts = [part for h in HARMONICS for part in (np.cos(h * t) * modulation, -np.sin(h * t) * modulation)]
    return np.stack(parts, axis=-1)


def _gauss_newton(
    own: _Pixels, jacobian: FloatArray, harmonics: FloatArray, weight: FloatArray, mean: FloatArray
) -> tuple[FloatArray, AnyArray]:
    """One reduced step.

    Parameters
    ----------
    jacobian
        (frame, pixel, term), derivatives by the frame's own unknowns.
    harmonics
        (frame, pixel, 2·harmonics), derivatives by Re and Im of κ.
    weight, mean
        (term,) and (frame, term): weight of each unknown's prior (0: none), and its distance from the prior's mean.

    Returns
    -------
    changes
        (frame, term), and those of κ (complex).
    """
    frames, pixels, terms = jacobian.shape
    extra = harmonics.shape[2]
    count = frames * terms
    normal = np.zeros((count + extra, count + extra))
    blocks = np.matmul(jacobian.transpose(0, 2, 1), jacobian)
    cross = np.matmul(jacobian.transpose(0, 2, 1), harmonics)
    for n in range(frames):
        here = slice(n * terms, (n + 1) * terms)
        normal[here, here] = blocks[n]
        normal[here, count:] = cross[n]
        normal[count:, here] = cross[n].T
    flat = harmonics.reshape(-1, extra)
    normal[count:, count:] = flat.T @ flat
    right = np.concatenate(
        [np.matmul(jacobian.transpose(0, 2, 1), own.residual[..., None]).reshape(-1), flat.T @ own.residual.reshape(-1)]
    )
    # the pixels' own unknowns, orthonormalised, then projected out
    columns = np.stack([np.ones_like(own.value), own.value, own.slope], axis=-1).transpose(1, 0, 2)
    orthonormal = np.linalg.qr(columns)[0].astype(np.float32)  # (pixel, frame, 3)
    reduced = np.empty((pixels, 3, count + extra), dtype=np.float32)
    per_frame = orthonormal.transpose(0, 2, 1)[..., None] * jacobian.transpose(1, 0, 2).astype(np.float32)[:, None]
    reduced[..., :count] = per_frame.reshape(pixels, 3, count)
    reduced[..., count:] = np.matmul(orthonormal.transpose(0, 2, 1), harmonics.transpose(1, 0, 2).astype(np.float32))
    projected = np.einsum("pni,np->pi", orthonormal, own.residual).reshape(-1)
    rows = reduced.reshape(-1, count + extra)
    normal -= (rows.T @ rows).astype(np.float64)
    right -= rows.T @ projected.astype(np.float32)
    diagonal = np.einsum("ii->i", normal)
    diagonal[:count] += np.tile(weight, frames)
    right[:count] -= (weight * mean).reshape(-1)
    diagonal += 1e-7 * np.median(diagonal[diagonal > 0])
    solution = np.linalg.solve(normal, right)
    kappa = solution[count:].reshape(-1, 2)
    return solution[:count].reshape(frames, terms), kappa[:, 0] + 1j * kappa[:, 1]
