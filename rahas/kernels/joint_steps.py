"""Phase steps that vary over the field, solved jointly with the phase of some thousands of pixels.

The crank of this scanner tilts the projector, so one frame's step is not one number: it varies smoothly with the
slide coordinate v, that is with the unwrapped phase itself (never with the place in the image, where depth steps would
break it). Per frame n and pixel p

    I_pn = a_p + b_p·w(φ_p + δ_pn),    δ_pn = Σ_k C_nk·P_k(v_p),    w(t) = cos t + Σ_h Re(κ_h e^{iht}),

with Legendre polynomials P_0…P_2 and C free per frame, so that a tilting projector, a translated slide and a pivot
beside the projection centre are all in it, and stalls, slips and repeated frames are harmless. The waveform κ is one
for all pixels and locked to the pattern. Gauss–Newton over {C, κ}; the pixels' own (a, b, φ) are eliminated (Schur
complement). The steps of frames in the hold before the scan are zero: that fixes the gauge.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray, BoolArray, FloatArray

DEGREE = 2
HARMONICS = (2, 3)
OUTLIER_SIGMAS = 5.0


class StepField(NamedTuple):
    """The phase step of every frame as a function of unwrapped phase, and the pattern's waveform."""

    coefficients: FloatArray  # (frame, DEGREE + 1), radians, of Legendre polynomials
    centre: float  # radians, unwrapped phase that maps to 0
    half_range: float  # radians, unwrapped phase range that maps to [−1, 1]
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
        At most so many; it stops when no step changes by more than 0.1 mrad.

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
    kappa = np.zeros(len(HARMONICS), dtype=complex)
    phase = np.array(unwrapped, dtype=float)
    basis = np.polynomial.legendre.legvander((unwrapped - centre) / half_range, DEGREE)
    free = np.flatnonzero(~held)
    noise = inliers = last_change = np.nan
    for _ in range(iterations):
        delta = coefficients @ basis.T
        phase, modulation, residual, value, slope = _solve_pixels(levels, phase, delta, kappa)
        noise = float(1.4826 * np.median(np.abs(residual)))
        good = (np.abs(residual) < OUTLIER_SIGMAS * max(noise, 1e-3)).all(axis=0) & (modulation > 0)
        if good.mean() < 0.3:  # still far away: the worst third waits for the next round
            good = np.abs(residual).max(axis=0) <= np.quantile(np.abs(residual).max(axis=0), 0.67)
        inliers = float(good.mean())
        change, kappa_change = _gauss_newton(
            residual[:, good],
            value[:, good],
            modulation[good] * slope[:, good],
            _harmonics(phase[good] + delta[:, good], modulation[good]),
            basis[good],
            free,
        )
        coefficients[free] += change
        kappa = kappa + kappa_change
        last_change = float(np.abs(change).max()) if len(free) else 0.0
        if last_change < 1e-4:
            break
    return StepField(coefficients, centre, half_range, kappa, noise, inliers, last_change)


def _solve_pixels(
    levels: FloatArray, phase: FloatArray, delta: FloatArray, kappa: AnyArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """(a, b, φ) of each pixel at known steps; returns φ, b, residual, w and w′ at the solution."""
    for _ in range(2):
        value, slope = waveform_of(phase + delta, kappa)
        background, modulation, turned = _three_unknowns(levels, value, slope)
        shift = np.arctan2(turned, modulation)
        phase = phase + np.where(modulation > 0, shift, 0.0)
    value, slope = waveform_of(phase + delta, kappa)
    background, modulation, _ = _three_unknowns(levels, value, slope)
    return phase, modulation, levels - background - modulation * value, value, slope


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
    residual: FloatArray, value: FloatArray, slope: FloatArray, harmonics: FloatArray, basis: FloatArray, free: AnyArray
) -> tuple[FloatArray, AnyArray]:
    """One reduced step: changes of C (free frame, k) and of κ."""
    pixels = residual.shape[1]
    terms, extra = basis.shape[1], harmonics.shape[2]
    count = len(free) * terms
    normal = np.zeros((count + extra, count + extra))
    right = np.zeros(count + extra)
    jacobian = slope[free, :, None] * basis  # (free frame, pixel, k)
    own = np.matmul(jacobian.transpose(0, 2, 1), jacobian)
    cross = np.matmul(jacobian.transpose(0, 2, 1), harmonics[free])
    for i in range(len(free)):
        here = slice(i * terms, (i + 1) * terms)
        normal[here, here] = own[i]
        normal[here, count:] = cross[i]
        normal[count:, here] = cross[i].T
        right[here] = jacobian[i].T @ residual[free[i]]
    flat = harmonics.reshape(-1, extra)
    normal[count:, count:] = flat.T @ flat
    right[count:] = flat.T @ residual.reshape(-1)
    # the pixels' own unknowns, orthonormalised, then projected out
    own_columns = np.stack([np.ones_like(value), value, slope], axis=-1).transpose(1, 0, 2)  # (pixel, frame, 3)
    orthonormal = np.linalg.qr(own_columns)[0]
    reduced = np.empty((pixels, 3, count + extra), dtype=np.float32)
    weighted = orthonormal[:, free, :].transpose(0, 2, 1) * slope[free].T[:, None, :]  # (pixel, 3, free frame)
    reduced[..., :count] = (weighted[..., None] * basis[:, None, None, :]).reshape(pixels, 3, count)
    reduced[..., count:] = np.matmul(orthonormal.transpose(0, 2, 1), harmonics.transpose(1, 0, 2))
    projected = np.einsum("pni,np->pi", orthonormal, residual).reshape(-1)
    rows = reduced.reshape(-1, count + extra)
    normal -= (rows.T @ rows).astype(np.float64)
    right -= rows.T.astype(np.float64) @ projected
    normal[np.diag_indices_from(normal)] += 1e-7 * np.trace(normal) / len(normal)
    solution = np.linalg.solve(normal, right)
    kappa = solution[count:].reshape(-1, 2)
    return solution[:count].reshape(len(free), terms), kappa[:, 0] + 1j * kappa[:, 1]
