"""The pattern's waveform, one for all pixels and locked to the pattern's phase, but depending on brightness.

    w(t) = cos t + Σ_{h=2…6} Re(κ_h e^{iht}),    κ_h(a, b) = κ_h0 + Σ_j k_hj·T_j(a, b)

The slide's density makes κ_h0, which may be complex. What depends on brightness is the camera's response, a curve that
every pixel shares; a curve cannot make a symmetric waveform lopsided, so the k_hj are real. Free harmonics of each
pixel would let the step warp δ → δ + ε·sin δ hide in them: so there are none.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray, FloatArray

HARMONICS = (2, 3, 4, 5, 6)
TERMS = 5  # A, B, A², AB, B² of the scaled background and modulation
UNKNOWNS = len(HARMONICS) * (2 + TERMS)
PRIOR_CONSTANT, PRIOR_RESPONSE = 0.3, 0.1  # standard deviations about zero


class Waveform(NamedTuple):
    """κ_h as a function of a pixel's background a and modulation b."""

    constant: AnyArray  # (harmonic,) complex, κ_h0
    response: FloatArray  # (harmonic, TERMS), k_hj
    centre: FloatArray  # (2,), grey levels, a and b that are scaled to 0
    low: FloatArray  # (2,), scaled a and b below which nothing was seen: κ stays what it is there
    high: FloatArray  # (2,), the same above

    def at(self, background: AnyArray, modulation: AnyArray) -> AnyArray:
        """κ (harmonic, *shape) complex, of pixels with such a and b in grey levels."""
        terms = np.moveaxis(self.terms(background, modulation), -1, 0)
        constant = self.constant.reshape(-1, *[1] * np.ndim(background))
        return constant + np.tensordot(self.response, terms, axes=1)

    def terms(self, background: AnyArray, modulation: AnyArray) -> FloatArray:
        """T_j (*shape, TERMS)."""
        a = np.clip(background / self.centre[0] - 1.0, self.low[0], self.high[0])
        b = np.clip(modulation / self.centre[1] - 1.0, self.low[1], self.high[1])
        return np.stack([a, b, a * a, a * b, b * b], axis=-1)

    def changed(self, unknowns: FloatArray) -> Waveform:
        """The waveform with (UNKNOWNS,) added, in the order of :func:`waveform_columns`."""
        table = unknowns.reshape(len(HARMONICS), 2 + TERMS)
        return self._replace(
            constant=self.constant + table[:, 0] + 1j * table[:, 1], response=self.response + table[:, 2:]
        )

    def unknowns(self) -> FloatArray:
        """(UNKNOWNS,), in the order of :func:`waveform_columns`."""
        return np.column_stack([self.constant.real, self.constant.imag, self.response]).reshape(-1)


def pure_cosine(background: FloatArray, modulation: FloatArray) -> Waveform:
    """No harmonics, scaled to these pixels' a and b (pixel,)."""
    both = np.stack([background, modulation])
    centre = np.maximum(np.median(both, axis=1), 1e-3)
    scaled = both / centre[:, None] - 1.0
    low, high = np.quantile(scaled, [0.01, 0.99], axis=1)
    return Waveform(np.zeros(len(HARMONICS), complex), np.zeros((len(HARMONICS), TERMS)), centre, low, high)


def waveform_of(t: FloatArray, kappa: AnyArray) -> tuple[FloatArray, FloatArray]:
    """The waveform w and its derivative w′ at phases ``t`` (…, pixel) in radians; κ is (harmonic, pixel)."""
    powers = _powers(t)
    value, slope = powers[0][0].copy(), -powers[0][1]
    for harmonic, k, (cosine, sine) in zip(HARMONICS, kappa, powers[1:], strict=True):
        real, imaginary = k.real.astype(t.dtype), k.imag.astype(t.dtype)
        value += real * cosine - imaginary * sine
        slope -= harmonic * real * sine + harmonic * imaginary * cosine
    return value, slope


def waveform_columns(t: FloatArray, modulation: FloatArray, terms: FloatArray) -> FloatArray:
    """Derivatives of the frames by κ's unknowns: (frame, pixel, UNKNOWNS); t (frame, pixel), terms (pixel, TERMS)."""
    columns = np.empty((*t.shape, len(HARMONICS), 2 + TERMS), dtype=t.dtype)
    for number, (cosine, sine) in enumerate(_powers(t)[1:]):
        columns[..., number, 0] = cosine * modulation
        columns[..., number, 1] = -sine * modulation
        columns[..., number, 2:] = columns[..., number, :1] * terms.astype(t.dtype)
    return columns.reshape(*t.shape, UNKNOWNS)


def _powers(t: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """cos ht and sin ht for h = 1, 2, …"""
    powers = [(np.cos(t), np.sin(t))]
    first_cosine, first_sine = powers[0]
    for _ in HARMONICS:
        cosine, sine = powers[-1]
        powers.append((cosine * first_cosine - sine * first_sine, sine * first_cosine + cosine * first_sine))
    return powers


def prior_weights() -> FloatArray:
    """(UNKNOWNS,), one over the variance of each unknown's prior."""
    one = np.r_[[PRIOR_CONSTANT**-2] * 2, [PRIOR_RESPONSE**-2] * TERMS]
    return np.tile(one, len(HARMONICS))


assert tuple(range(2, 2 + len(HARMONICS))) == HARMONICS  # the powers above count up one by one
