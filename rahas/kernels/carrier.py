"""Stripes of a hold as a carrier: a small turn of the slide is a phase ramp along them, a shift a phase offset.

Near a stop a turn by δθ about the slide's centre changes the pattern's phase by the *other* alignment's phase times
sin δθ (thesis B.1). Demodulating a frame with the hold's own stripes leaves that change alone; its slope along the
stripes over the other alignment's wave number is sin δθ, with no unwrapping and no slide centre.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rahas.kernels.frame_blocks import frame_blocks
from rahas.typing import Float32Array, FloatArray, FrameStack

ComplexArray = NDArray[np.complex128]

_LINES = 128
"""Lines transformed at a time: spectra take some times the image."""


class Carrier(NamedTuple):
    """The stripes of one hold."""

    signal: ComplexArray
    """(y, x) analytic stripes a·exp(iΦ), Φ growing along ``axis``."""
    axis: int
    """Image axis that Φ grows along: 1 = x (epipolar alignment), 0 = y (phase alignment)."""
    wave_number: float
    """Mean phase per pixel along ``axis``, radians, weighted by the signal's power."""


def carrier_from_stripes(stripes: FloatArray, *, axis: int) -> Carrier:
    """The analytic signal of ``stripes`` (y, x) along ``axis``: one side of the spectrum, 0.4 … 2.2 of its peak."""
    along = np.moveaxis(np.asarray(stripes), axis, -1)
    lines, size = along.shape
    window = np.hanning(size + 2)[1:-1]
    power = np.zeros(size // 2 + 1)
    parts = [slice(first, first + _LINES) for first in range(0, lines, _LINES)]
    for part in parts:
        power += (np.abs(np.fft.rfft(along[part] * window)) ** 2).sum(0)
    power[: max(2, size // 100)] = 0
    peak = int(power.argmax())
    order = np.arange(size)
    band = np.where((order > 0.4 * peak) & (order < min(2.2 * peak, size / 2)), 2.0, 0.0)
    signal = np.empty((lines, size), np.result_type(along.dtype, np.complex64))
    lag_product = 0j
    for part in parts:
        signal[part] = np.fft.ifft(np.fft.fft(along[part].astype(np.float64)) * band)
        lag_product += (signal[part, 1:] * signal[part, :-1].conj()).sum()
    wave_number = float(np.angle(lag_product))
    return Carrier(np.moveaxis(signal, -1, axis), axis, wave_number)


def demodulate(
    stack: FrameStack, carrier: Carrier, *, background: Float32Array, first: int, stop: int, scale: float = 1.0
) -> ComplexArray:
    """Σ over the carrier's axis of conj(carrier)·(frame − background): (frame, position along the stripes)."""
    real, imaginary = (part.astype(np.float32) for part in (carrier.signal.real, -carrier.signal.imag))
    sums = np.empty((stop - first, carrier.signal.shape[1 - carrier.axis]), np.complex128)
    spec = "nyx,yx->nx" if carrier.axis == 0 else "nyx,yx->ny"
    for frames, values in frame_blocks(stack, first=first, stop=stop, scale=scale):
        values -= background
        into = slice(frames.start - first, frames.stop - first)
        sums[into] = np.einsum(spec, values, real) + 1j * np.einsum(spec, values, imaginary)
    return sums


def ramp_slope(sums: ComplexArray, *, held: slice) -> FloatArray:
    """Phase slope (radians a pixel) of each frame's demodulated line (frame, position), 0 in the frames ``held``.

    By lag products: a short lag first, then one as long as the lit part's spread, whose phase the short one has brought
    within a turn.
    """
    reference = sums[held].mean(0)
    sums = sums * np.exp(-1j * np.angle(reference))
    power = (np.abs(sums) ** 2).mean(0)
    place = np.arange(sums.shape[1])
    centre = np.average(place, weights=power)
    spread = float(np.sqrt(np.average((place - centre) ** 2, weights=power)))
    slope = _mean_slope(sums, lag=max(1, round(spread / 4)))
    return slope + _mean_slope(sums * np.exp(-1j * np.outer(slope, place)), lag=max(1, round(spread)))


def _mean_slope(lines: ComplexArray, *, lag: int) -> FloatArray:
    """Mean phase slope of each line (line, position), weighted by power."""
    return np.asarray(np.angle((lines[:, lag:] * lines[:, :-lag].conj()).sum(1)) / lag)
