"""The pattern on the scene during one exposure: the renderer's inner loop.

Pattern phase (thesis B.1): ψ = π·stripes·[(u' − u0)·cos θ + (v' − v0)·sin θ], (u', v') the slide point that lights
the pixel now. A tilt τ of the projector about its own x axis gives, with s the tangent of the half field,
v' = tan(atan(s·v) − τ)/s and u' = u / (cos τ·(1 + s·v·tan τ)); a true translation gives v' = v − d.
The projector's lens takes the ideal slide point to that times 1 + k1·s²·(u² + v²), after a tilt, before a translation.
A slide that sits askew in its holder shifts ψ by the same phase at every angle.
A phase that moves evenly from ψ₁ to ψ₂ during the exposure shows cos((ψ₁ + ψ₂)/2)·sinc((ψ₂ − ψ₁)/2).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from rahas.simulate.hand import Motion
from rahas.simulate.specs import RigSpec
from rahas.typing import Float32Array, FloatArray

TWO_PI = 2 * math.pi


@numba.njit(cache=True, inline="always", fastmath=True)
def _cosine(turns: np.float32) -> np.float32:
    """Cos of 2π·turns to about 1e-6: a polynomial that vectorises."""
    x = turns - np.floor(turns + np.float32(0.5))
    y = np.float32(TWO_PI) * (np.float32(0.25) - abs(x))
    z = y * y
    return y * (
        np.float32(1)
        + z
        * (
            np.float32(-1 / 6)
            + z
            * (
                np.float32(1 / 120)
                + z * (np.float32(-1 / 5040) + z * (np.float32(1 / 362880) + z * np.float32(-1 / 39916800)))
            )
        )
    )


@numba.njit(cache=True, inline="always", fastmath=True)
def _sinc(square: np.float32) -> np.float32:
    """sin(x)/x of x², good to 1e-3 up to x = 2.5."""
    one = np.float32(1)
    return one - square * np.float32(1 / 6) * (
        one - square * np.float32(1 / 20) * (one - square * np.float32(1 / 42) * (one - square * np.float32(1 / 72)))
    )


@numba.njit(cache=True, fastmath=True)
def _lit_pattern(
    out: Float32Array,
    u: Float32Array,
    v: Float32Array,
    light: Float32Array,
    slide: FloatArray,
    rows: FloatArray,
    tilting: bool,
    first: int,
    step: int,
) -> None:
    """Lamp light of the rows first, first + step, … into ``out``.

    ``slide``: stripes/2, u0, v0, s, half aperture, contrast, second harmonic, k1·s², shift in turns.
    ``rows`` (y, 7): cos θ, sin θ, crank at the start of the row's exposure, the same at its end, lamp.
    """
    half_stripes, u0, v0, s = np.float32(slide[0]), np.float32(slide[1]), np.float32(slide[2]), np.float32(slide[3])
    aperture, contrast, second = np.float32(slide[4]), np.float32(slide[5]), np.float32(slide[6])
    bend, shift = np.float32(slide[7]), np.float32(slide[8])
    one, half, radius, soft = np.float32(1), np.float32(0.5), np.float32(0.25 * slide[4]), np.float32(1 / 0.012)
    for i in range(first, out.shape[0], step):
        cos_1, sin_1, cos_2, sin_2 = (
            np.float32(rows[i, 0]),
            np.float32(rows[i, 1]),
            np.float32(rows[i, 3]),
            np.float32(rows[i, 4]),
        )
        lamp = np.float32(rows[i, 6])
        way_1, way_2 = np.float32(rows[i, 2]), np.float32(rows[i, 5])
        tan_1, tan_2 = np.float32(math.tan(rows[i, 2])), np.float32(math.tan(rows[i, 5]))
        across_1, across_2 = np.float32(1 / math.cos(rows[i, 2])), np.float32(1 / math.cos(rows[i, 5]))
        for j in range(out.shape[1]):
            a, b = u[i, j], v[i, j]
            if tilting:
                share_1, share_2 = one / (one + s * b * tan_1), one / (one + s * b * tan_2)
                u_1, u_2 = a * across_1 * share_1, a * across_2 * share_2
                v_1, v_2 = (b - tan_1 / s) * share_1, (b - tan_2 / s) * share_2
                swell_1, swell_2 = one + bend * (u_1 * u_1 + v_1 * v_1), one + bend * (u_2 * u_2 + v_2 * v_2)
                u_1, u_2, v_1, v_2 = u_1 * swell_1, u_2 * swell_2, v_1 * swell_1, v_2 * swell_2
            else:
                swell_1 = one + bend * (a * a + b * b)
                u_1, u_2, v_1, v_2 = a * swell_1, a * swell_1, b * swell_1 - way_1, b * swell_1 - way_2
            turns_1 = half_stripes * ((u_1 - u0) * cos_1 + (v_1 - v0) * sin_1) + shift
            turns_2 = half_stripes * ((u_2 - u0) * cos_2 + (v_2 - v0) * sin_2) + shift
            middle = half * (turns_1 + turns_2)
            swing = np.float32(math.pi) * (turns_2 - turns_1)
            swing = swing * swing
            wave = _cosine(middle) * _sinc(swing)
            if second != 0:
                swing = np.float32(4) * swing
                wave = wave + second * _cosine(np.float32(2) * middle) * _sinc(swing)
            over_u = max(abs(half * (u_1 + u_2)) - aperture + radius, np.float32(0))
            over_v = max(abs(half * (v_1 + v_2)) - aperture + radius, np.float32(0))
            inside = (radius - math.sqrt(over_u * over_u + over_v * over_v)) * soft + half
            inside = min(max(np.float32(inside), np.float32(0)), one)
            out[i, j] = light[i, j] * lamp * inside * half * (one + contrast * wave)


@numba.njit(cache=True, fastmath=True)
def shifted(field: Float32Array, shift_x: float, shift_y: float) -> Float32Array:
    """``field`` (y, x) moved right and down by a part of a pixel and more: cubic (Catmull–Rom), edges repeated."""
    rows, columns = field.shape
    across, out = np.empty_like(field), np.empty_like(field)
    whole = math.floor(-shift_x)
    w0, w1, w2, w3 = _cubic(-shift_x - whole)
    for i in range(rows):
        for j in range(columns):
            k = j + whole
            if k >= 1 and k + 2 < columns:
                across[i, j] = w0 * field[i, k - 1] + w1 * field[i, k] + w2 * field[i, k + 1] + w3 * field[i, k + 2]
            else:
                across[i, j] = field[i, min(max(k, 0), columns - 1)]
    whole = math.floor(-shift_y)
    w0, w1, w2, w3 = _cubic(-shift_y - whole)
    for i in range(rows):
        k = i + whole
        a, b = min(max(k - 1, 0), rows - 1), min(max(k, 0), rows - 1)
        c, d = min(max(k + 1, 0), rows - 1), min(max(k + 2, 0), rows - 1)
        for j in range(columns):
            out[i, j] = w0 * across[a, j] + w1 * across[b, j] + w2 * across[c, j] + w3 * across[d, j]
    return out


@numba.njit(cache=True, inline="always")
def _cubic(t: float) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    return (
        np.float32(-0.5 * t + t * t - 0.5 * t**3),
        np.float32(1 - 2.5 * t * t + 1.5 * t**3),
        np.float32(0.5 * t + 2 * t * t - 1.5 * t**3),
        np.float32(-0.5 * t * t + 0.5 * t**3),
    )


def slide_constants(rig: RigSpec) -> FloatArray:
    """The rig's numbers that :func:`_lit_pattern` wants."""
    tangent = np.tan(np.deg2rad(rig.half_field_deg))
    bend, shift = rig.projector_radial_k1 * tangent**2, rig.slide_shift_rad / (2 * np.pi)
    return np.array(
        [
            rig.stripes / 2,
            rig.centre_u,
            rig.centre_v,
            tangent,
            rig.aperture,
            rig.contrast,
            rig.second_harmonic,
            bend,
            shift,
        ]
    )


def row_courses(motion: Motion, start_s: FloatArray, end_s: FloatArray) -> FloatArray:
    """Course of each row's exposure (y, 7), as :func:`_lit_pattern` wants it."""
    columns = []
    for time in (start_s, end_s):
        theta = motion.at("theta", time)
        columns += [np.cos(theta), np.sin(theta), motion.at("crank", time)]
    return np.stack([*columns, motion.at("lamp", (start_s + end_s) / 2)], axis=-1)


def pattern_phase(
    rig: RigSpec,
    u: FloatArray | float,
    v: FloatArray | float,
    *,
    theta: FloatArray | float,
    crank: FloatArray | float,
) -> FloatArray:
    """ψ in rad at reference slide points (u, v) for a slide angle and a crank position: the slow, exact form."""
    tangent = np.tan(np.deg2rad(rig.half_field_deg))
    if rig.crank == "tilt":
        share = 1 / (1 + tangent * v * np.tan(crank))
        u, v = u / np.cos(crank) * share, (v - np.tan(crank) / tangent) * share
    swell = 1 + rig.projector_radial_k1 * tangent**2 * (u * u + v * v)
    u, v = u * swell, v * swell - (0 if rig.crank == "tilt" else crank)
    turned = (u - rig.centre_u) * np.cos(theta) + (v - rig.centre_v) * np.sin(theta)
    return np.asarray(np.pi * rig.stripes * turned + rig.slide_shift_rad)


def add_pattern(
    out: Float32Array,
    maps_uvl: tuple[Float32Array, Float32Array, Float32Array],
    rig: RigSpec,
    rows: FloatArray,
    *,
    first: int = 0,
    step: int = 1,
) -> None:
    """Lamp light of the rows first, first + step, … of a moment into ``out`` (y, x)."""
    _lit_pattern(out, *maps_uvl, slide_constants(rig), rows, rig.crank == "tilt", first, step)
