"""Phase steps that vary over the field, solved jointly with the phase of some thousands of pixels.

The crank of this scanner tilts the projector, so one frame's step is not one number: it varies smoothly with the
slide coordinate v, that is with the unwrapped phase itself (never with the place in the image, where depth steps would
break it). Per frame n and pixel p

    I_pn = g_n·(a_p + b_p·w(φ_p + δ_pn)) + o_n,    δ_pn = s_p·Σ_k C_nk·P_k(v_p),

with Legendre polynomials P_0…P_2 and C free per frame, so that a tilting projector, a translated slide and a pivot
beside the projection centre are all in it, and stalls, slips and repeated frames are harmless. What a projector lens
that distorts, and a second stop that is not quite 90°, change across the field is the same share of the step in every
frame: s_p = 1 + e_1·u_p + e_2·u_p² + e_3·u_p·v_p, where u_p, the other slide coordinate, is told from the image column
well enough. The waveform w is
shared (:mod:`rahas.kernels.waveform`). Gauss–Newton over {C, g, o, w}; the pixels' own (a, b, φ) are projected out. The
steps of frames in the hold before the scan are zero: that fixes the gauge. Gain and offset (auto-exposure, flicker,
ambient drift) have priors around 1 and 0 as wide as they turn out to scatter, for a gain that ripples with the step is
hard to tell from a warped step; a steady drift of either costs nothing. So has the displacement of the object in the
image, where it is asked for. The terms P_1, P_2 have priors too, about any quadratic function of the step: what a
tilting cam makes of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rahas.kernels.displacement import frame_slopes
from rahas.kernels.pixel_fit import PixelFit, fit_pixels
from rahas.kernels.reduced_step import Prior, reduced_step, without_courses
from rahas.kernels.waveform import Waveform, prior_weights, pure_cosine, waveform_columns
from rahas.typing import AnyArray, BoolArray, FloatArray

DEGREE = 2
OUTLIER_SIGMAS = 5.0
CONVERGED_RAD = 2.5e-3  # Gauss–Newton: what is left after such a change is far smaller
MANY_FRAMES = 100  # with fewer, the unknowns are less apart from each other and it goes more slowly
# standard deviations of the step's terms beyond the first (rad), the gain, the offset over the median background, and
# the shift (px): at the start, and at the least
PRIOR_START = np.r_[[0.3] * DEGREE, 0.03, 0.03, 0.3, 0.3]
ACROSS = 3  # terms of s
ACROSS_PRIOR = 0.05  # standard deviation about zero
UNIFORM_RAD = 1e-7  # as good as not at all
PRIOR_LEAST = np.r_[[1e-4] * DEGREE, 2e-4, 2e-4, 3e-3, 3e-3]


class StepField(NamedTuple):
    """The phase step of every frame as a function of unwrapped phase, and the pattern's waveform."""

    coefficients: FloatArray  # (frame, DEGREE + 1), radians, of Legendre polynomials
    centre: float  # radians, unwrapped phase that maps to 0
    half_range: float  # radians, unwrapped phase range that maps to [−1, 1]
    gain: FloatArray  # (frame,), g, 1 on average
    offset: FloatArray  # (frame,), o, grey levels, 0 on average
    across: FloatArray  # (3,), e: relative change of the step with u, u² and u·v
    shift: FloatArray  # (frame, 2), px, displacement of the object in the image along x and y; 0 if not asked for
    waveform: Waveform
    noise: float  # grey levels, robust standard deviation of the residuals
    inliers: float  # share of the pixels that follow the model in every frame
    last_change: float  # radians, largest change of phase that the last iteration made

    def steps_at(self, unwrapped: AnyArray, across: AnyArray | float = 0.0) -> FloatArray:
        """Steps (frame, *shape of unwrapped), radians, where ``across`` is the slide coordinate u, −1 … 1."""
        return np.tensordot(self.coefficients, self.basis(unwrapped, across), axes=1)

    def moved_back(self, carrier: FloatArray) -> StepField:
        """The field of frames whose displacement was undone, which moved the carrier (2,) in radians per px."""
        steps = self.coefficients.copy()
        steps[:, 0] += self.shift @ carrier
        return self._replace(coefficients=steps, shift=np.zeros_like(self.shift))

    def basis(self, unwrapped: AnyArray, across: AnyArray | float = 0.0) -> FloatArray:
        """Legendre polynomials times s (DEGREE + 1, *shape), at unwrapped phases in radians and coordinates u."""
        along = self._along(unwrapped)
        share = 1.0 + np.tensordot(self.across, _across_terms(along, across), axes=1)
        return np.moveaxis(np.polynomial.legendre.legvander(along, DEGREE), -1, 0) * share

    def by_across(self, unwrapped: AnyArray, across: AnyArray) -> FloatArray:
        """Derivatives of the steps by e: (frame, pixel, 3)."""
        along = self._along(unwrapped)
        plain = self.coefficients @ np.polynomial.legendre.legvander(along, DEGREE).T
        return plain[..., None] * _across_terms(along, across).T

    def _along(self, unwrapped: AnyArray) -> FloatArray:
        return (np.asarray(unwrapped, dtype=float) - self.centre) / self.half_range


def across_image(width: int) -> FloatArray:
    """Slide coordinate u (x,) of the image's columns, up to a factor and a shift."""
    return np.linspace(-1.0, 1.0, width)


def _across_terms(along: FloatArray, across: AnyArray | float) -> FloatArray:
    """What e multiplies (3, *shape)."""
    u = np.broadcast_to(np.asarray(across, dtype=float), along.shape)
    return np.stack([u, u * u, u * along])


def solve_joint_steps(
    levels: AnyArray,
    unwrapped: FloatArray,
    steps: FloatArray,
    held: BoolArray,
    *,
    across: FloatArray | None = None,
    slopes: FloatArray | None = None,
    uniform: bool = False,
    iterations: int = 20,
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
        (frame,), frames whose step stays as given, the same over the field (in the hold before the scan: zero); at
        least one.
    across
        (pixel,), slide coordinate u, −1 … 1 over the image; without it the step is taken not to change with u.
    slopes
        (2, 3, pixel), grey levels per px along x and y of the images a, b cos φ and −b sin φ: if given, the object's
        displacement in each frame is found too.
    uniform
        The step of a frame is the same over the whole field: a slide truly translated.
    iterations
        At most so many; it stops when no step changes by more than 2.5 mrad, or less where frames are few.

    Raises
    ------
    ValueError
        No held frame, or too few pixels for the unknowns.
    """
    levels = np.asarray(levels, dtype=np.float32)
    frames, pixels = levels.shape
    if not held.any() or pixels < 20 * (DEGREE + 1):
        raise ValueError(f"{held.sum() = }, {pixels = }: a held frame and {20 * (DEGREE + 1)} pixels are needed")
    terms = DEGREE + 1
    field = StepField(
        coefficients=np.column_stack([steps, *[np.zeros(frames)] * DEGREE]),
        centre=float(0.5 * (unwrapped.min() + unwrapped.max())),
        half_range=max(0.5 * float(np.ptp(unwrapped)), np.pi),
        gain=np.ones(frames),
        offset=np.zeros(frames),
        across=np.zeros(ACROSS),
        shift=np.zeros((frames, 2)),
        waveform=pure_cosine(np.ones(1), np.ones(1)),
        noise=np.nan,
        inliers=np.nan,
        last_change=np.nan,
    )
    place = np.zeros(pixels) if across is None else across
    phase = np.asarray(unwrapped, dtype=np.float32)
    background = modulation = np.ones(pixels, np.float32)
    for number in range(iterations):
        basis = field.basis(unwrapped, place).astype(np.float32)
        delta = field.coefficients.astype(np.float32) @ basis
        kappa = field.waveform.at(background, modulation)
        own = fit_pixels(_undone(levels, field, delta, slopes), phase, delta, kappa, rounds=1 if number else 2)
        phase, background, modulation = own.phase, own.background, own.modulation
        noise, good, inliers = _followers(own)
        own = own.only(good)
        if number == 0:
            field = field._replace(waveform=pure_cosine(own.background, own.modulation))
        level = float(np.median(own.background))
        prior = _prior(field, noise, level, first=number == 0, shifting=slopes is not None, uniform=uniform)
        by_across = field.by_across(unwrapped[good], place[good]).astype(np.float32)
        columns = _columns(
            field.waveform,
            delta[:, good],
            basis[:, good],
            by_across,
            held,
            slopes if slopes is None else slopes[..., good],
        )
        change, shared = reduced_step(own, columns, prior)
        change[held, :terms] = 0.0
        former = field.waveform.constant
        field = _changed(field, change, shared)
        turned = max(np.abs(change[:, :terms]).max(), 0.5 * np.abs(field.waveform.constant - former).max())
        field = field._replace(noise=noise, inliers=inliers, last_change=float(turned))
        if field.last_change < CONVERGED_RAD * min(1.0, frames / MANY_FRAMES):
            break
    return field


def _prior(field: StepField, noise: float, level: float, *, first: bool, shifting: bool, uniform: bool) -> Prior:
    """Priors as wide as the unknowns are seen to scatter about what they need no excuse for."""
    frames, steps = len(field.gain), field.coefficients[:, 0]
    motion = np.stack([steps, steps**2], axis=1) / max(float(np.abs(steps).max()), 1e-6) ** np.array([1.0, 2.0])
    drift = (np.arange(frames) - 0.5 * (frames - 1))[:, None]
    courses: list[FloatArray] = [motion] * DEGREE + [drift] * 2 + [np.zeros((frames, 0))] * 2
    present = np.column_stack([field.coefficients[:, 1:], field.gain - 1.0, field.offset, field.shift])
    unit = np.r_[np.ones(DEGREE), 1.0, level, 1.0, 1.0]
    scatter = np.stack([without_courses(c) @ p for c, p in zip(courses, present.T, strict=True)], axis=1)
    spread = PRIOR_START if first else np.maximum(np.std(scatter, axis=0) / unit, PRIOR_LEAST)
    if uniform:
        courses[:DEGREE] = [np.zeros((frames, 0))] * DEGREE
        spread = np.r_[[UNIFORM_RAD] * DEGREE, spread[DEGREE:]]
    count = DEGREE + (4 if shifting else 2)
    free = np.zeros((frames, 0))
    return Prior(
        np.r_[0.0, noise**2 / (spread * unit)[:count] ** 2],
        np.column_stack([np.zeros(frames), present[:, :count]]),
        [free, *courses[:count]],
        noise**2 * np.r_[prior_weights(), [(UNIFORM_RAD if uniform else ACROSS_PRIOR) ** -2] * ACROSS],
        np.r_[field.waveform.unknowns(), field.across],
    )


def levelled(levels: FloatArray, field: StepField) -> FloatArray:
    """Frames (frame, pixel) with gain and offset taken out."""
    offset, gain = (np.asarray(part[:, None], np.float32) for part in (field.offset, field.gain))
    flat: FloatArray = (levels - offset) / gain
    return flat


def _undone(levels: FloatArray, field: StepField, delta: FloatArray, slopes: FloatArray | None) -> FloatArray:
    """Frames with gain, offset and displacement taken out."""
    flat = levelled(levels, field)
    if slopes is None:
        return flat
    for columns, shift in zip(frame_slopes(delta, slopes), field.shift.T, strict=True):
        flat = flat - columns * shift[:, None].astype(np.float32)
    return flat


def _followers(own: PixelFit) -> tuple[float, BoolArray, float]:
    """Noise, the pixels that follow the model in every frame, and their share."""
    size = np.abs(own.residual)
    noise = float(max(1.4826 * np.median(size), 1e-3))
    worst = size.max(axis=0)
    good = (worst < OUTLIER_SIGMAS * noise) & (own.modulation > 0)
    share = float(good.mean())
    if share < 0.3:  # still far away: the worst third waits for the next round
        good = (worst <= np.quantile(worst, 0.67)) & (own.modulation > 0)
    return noise, good, share


def _columns(
    waveform: Waveform,
    delta: FloatArray,
    basis: FloatArray,
    by_across: FloatArray,
    held: BoolArray,
    slopes: FloatArray | None,
) -> Callable[[PixelFit, slice], tuple[FloatArray, FloatArray]]:
    """Derivatives of the frames by their own unknowns and by the shared ones, for a part of the pixels at a time."""

    def columns(own: PixelFit, part: slice) -> tuple[FloatArray, FloatArray]:
        by_frame = frame_columns(own, basis[:, part], held)
        if slopes is not None:
            shifting = frame_slopes(delta[:, part], slopes[..., part]).transpose(1, 2, 0)
            by_frame = np.concatenate([by_frame, shifting], axis=-1)
        terms = waveform.terms(own.background, own.modulation)
        by_waveform = waveform_columns(own.phase + delta[:, part], own.modulation, terms)
        turned = (own.modulation * own.slope)[..., None] * by_across[:, part]
        return by_frame, np.concatenate([by_waveform, turned], axis=-1)

    return columns


def frame_columns(own: PixelFit, basis: FloatArray, held: BoolArray) -> FloatArray:
    """Derivatives of the frames by their own steps, gain and offset: (frame, pixel, term)."""
    moving = (own.modulation * own.slope) * ~held[:, None]
    columns = [moving * polynomial for polynomial in basis]
    columns += [own.background + own.modulation * own.value, np.ones_like(own.value)]
    return np.stack(columns, axis=-1, dtype=np.float32)


def _changed(field: StepField, change: FloatArray, shared: FloatArray) -> StepField:
    steps, gain, offset, shift = (
        change[:, : DEGREE + 1],
        change[:, DEGREE + 1],
        change[:, DEGREE + 2],
        change[:, DEGREE + 3 :],
    )
    new_gain = field.gain * (1.0 + gain)
    new_offset = field.offset + field.gain * offset
    return field._replace(
        coefficients=field.coefficients + steps,
        gain=new_gain / new_gain.mean(),
        offset=new_offset - new_offset.mean(),
        shift=field.shift + (shift if shift.shape[1] else 0.0),
        across=field.across + shared[-ACROSS:],
        waveform=field.waveform.changed(shared[:-ACROSS]),
    )
