"""Slide angle from the direction of the stripes.

At a slide angle θ the pattern's phase gradient at a pixel is g0·cos θ + g90·sin θ, g0 and g90 its gradients at the two
stops (thesis B.1: the phase is linear in cos θ and sin θ, whatever the surface). So the structure tensor ⟨g gᵀ⟩ of the
field is, relief and oblique view included,

    J(θ) = cos²θ·J0 + sin²θ·J90 + sin 2θ·J×,

J0 and J90 measured at the holds, J× (three numbers) fitted to the rotation as a whole. A tensor is given as its
components (xx, xy, yy); x to the right, y down.
"""

from __future__ import annotations

import numpy as np

from rahas.typing import Float32Array, FloatArray


def gradient_tensors(stripes: Float32Array, weight: Float32Array) -> FloatArray:
    """Structure tensor of each frame, (frame, 3), from central differences of ``stripes`` (frame, y, x)."""
    gradient_x = stripes[:, 1:-1, 2:] - stripes[:, 1:-1, :-2]
    gradient_y = stripes[:, 2:, 1:-1] - stripes[:, :-2, 1:-1]
    inner = weight[1:-1, 1:-1] / weight[1:-1, 1:-1].sum()
    pairs = ((gradient_x, gradient_x), (gradient_x, gradient_y), (gradient_y, gradient_y))
    return np.stack([np.einsum("nyx,nyx,yx->n", a, b, inner) for a, b in pairs], axis=1).astype(np.float64)


def gradient_direction_deg(tensors: FloatArray) -> FloatArray:
    """Direction of the phase gradient, degrees from +x towards +y, known modulo 180, in [-90, 90]."""
    return np.degrees(0.5 * np.arctan2(2 * tensors[..., 1], tensors[..., 0] - tensors[..., 2]))


def slide_angle_from_tensors(
    tensors: FloatArray, *, first_stop: FloatArray, second_stop: FloatArray, sense: int, iterations: int = 8
) -> FloatArray:
    """Slide angle of each frame of a rotation, degrees: 0 at ``first_stop``'s tensor, 90 at ``second_stop``'s.

    Parameters
    ----------
    tensors
        (frame, 3), noise taken out; a frame's overall strength does not matter.
    first_stop, second_stop
        (3) tensors of the two holds, of the same strength.
    sense
        +1 where the gradient turns from +x to +y, −1 where it turns from −x to +y.
    """
    cross = np.array([0.0, sense * 0.5 * np.sqrt(max(first_stop[0] * second_stop[2], 0.0)), 0.0])
    angle = np.zeros(len(tensors))
    for _ in range(iterations):
        shares = np.linalg.lstsq(np.stack([first_stop, cross, second_stop], axis=1), tensors.T, rcond=None)[0]
        angle = 0.5 * np.arctan2(shares[1], shares[0] - shares[2])
        cosine, sine, double = np.cos(angle) ** 2, np.sin(angle) ** 2, np.sin(2 * angle)
        model = np.outer(cosine, first_stop) + np.outer(sine, second_stop) + np.outer(double, cross)
        strength = (tensors * model).sum(1) / np.maximum((model**2).sum(1), np.finfo(float).tiny)
        rest = tensors - strength[:, None] * (np.outer(cosine, first_stop) + np.outer(sine, second_stop))
        lever = strength * double
        if (lever**2).sum() <= 0:
            break
        cross = lever @ rest / (lever**2).sum()
    return np.degrees(np.where(angle < -np.pi / 4, angle + np.pi, angle))
