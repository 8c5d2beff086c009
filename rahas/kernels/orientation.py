"""Slide angle from the direction of the stripes.

At a slide angle θ the pattern's phase gradient at a pixel is g0·cos θ + g90·sin θ, g0 and g90 its gradients at the two
stops (thesis B.1: the phase is linear in cos θ and sin θ, whatever the surface). So the structure tensor ⟨g gᵀ⟩ of the
field is, relief and oblique view included,

    J(θ) = cos²θ·J0 + sin²θ·J90 + sin 2θ·J×,

J0 and J90 measured at the holds, J× (three numbers) fitted to the rotation as a whole. A tensor is given as its
components (xx, xy, yy); x to the right, y down.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rahas.typing import Float32Array, FloatArray

DERIVATIVE = (0.82459, -0.22026, 0.03974)
"""Antisymmetric derivative filter: true to 0.6 % for stripes of 3.7 pixels and more, so that its response does not
depend on the stripes' direction (central differences are 20 % off at 6 pixels, which is 3° at 45°)."""
REACH = len(DERIVATIVE)


class StripeTensors(NamedTuple):
    """Structure tensors and power of frames."""

    tensor: FloatArray
    """(frame, 3): xx, xy, yy."""
    power: FloatArray
    """(frame) mean square of the stripes over the same pixels."""

    def less(self, noise: StripeTensors) -> StripeTensors:
        """With the mean of ``noise`` taken out."""
        return StripeTensors(self.tensor - noise.tensor.mean(0), self.power - noise.power.mean())

    def of_even_strength(self) -> FloatArray:
        """(frame, 3) the tensor of stripes of unit power: exposure, flicker and blur drop out."""
        return self.tensor / np.maximum(self.power, np.finfo(float).tiny)[:, None]


def stripe_tensors(stripes: Float32Array, weight: Float32Array) -> StripeTensors:
    """Structure tensor of each frame of ``stripes`` (frame, y, x) over the field, pixels weighted by ``weight``."""
    inner = stripes[:, REACH:-REACH, REACH:-REACH]
    gradient_x, gradient_y = np.zeros_like(inner), np.zeros_like(inner)
    height, width = stripes.shape[1:]
    for lag, share in enumerate(DERIVATIVE, start=1):
        near, far = REACH - lag, REACH + lag
        rows, columns = slice(REACH, height - REACH), slice(REACH, width - REACH)
        ahead, behind = slice(far, width - near), slice(near, width - far)
        gradient_x += np.float32(share) * (stripes[:, rows, ahead] - stripes[:, rows, behind])
        ahead, behind = slice(far, height - near), slice(near, height - far)
        gradient_y += np.float32(share) * (stripes[:, ahead, columns] - stripes[:, behind, columns])
    share_of = weight[REACH:-REACH, REACH:-REACH]
    share_of = share_of / share_of.sum()
    pairs = ((gradient_x, gradient_x), (gradient_x, gradient_y), (gradient_y, gradient_y), (inner, inner))
    sums = [np.einsum("nyx,nyx,yx->n", a, b, share_of).astype(np.float64) for a, b in pairs]
    return StripeTensors(np.stack(sums[:3], axis=1), sums[3])


def gradient_direction_deg(tensors: FloatArray) -> FloatArray:
    """Direction of the phase gradient, degrees from +x towards +y, known modulo 180, in [-90, 90]."""
    return np.degrees(0.5 * np.arctan2(2 * tensors[..., 1], tensors[..., 0] - tensors[..., 2]))


def slide_angle_from_tensors(
    tensors: FloatArray, *, first_stop: FloatArray, second_stop: FloatArray, sense: int, iterations: int = 12
) -> FloatArray:
    """Slide angle of each frame of a rotation, degrees: 0 at ``first_stop``'s tensor, 90 at ``second_stop``'s.

    Parameters
    ----------
    tensors
        (frame, 3), noise taken out; a frame's overall strength does not matter, and frames that do not fit (a jolt of
        the rig) count little.
    first_stop, second_stop
        (3) tensors of the two holds, of the same strength.
    sense
        +1 where the gradient turns from +x to +y, −1 where it turns from −x to +y.
    """
    cross = _cross_tensor(_main_gradient(first_stop), _main_gradient(second_stop), sense)
    angle, trust = np.zeros(len(tensors)), np.ones(len(tensors))
    for _ in range(iterations):
        shares = np.linalg.lstsq(np.stack([first_stop, cross, second_stop], axis=1), tensors.T, rcond=None)[0]
        angle = 0.5 * np.arctan2(shares[1], shares[0] - shares[2])
        cosine, sine, double = np.cos(angle) ** 2, np.sin(angle) ** 2, np.sin(2 * angle)
        model = np.outer(cosine, first_stop) + np.outer(sine, second_stop) + np.outer(double, cross)
        strength = (tensors * model).sum(1) / np.maximum((model**2).sum(1), np.finfo(float).tiny)
        rest = tensors - strength[:, None] * (np.outer(cosine, first_stop) + np.outer(sine, second_stop))
        lever = strength * double
        misfit = np.linalg.norm(rest - lever[:, None] * cross, axis=1)
        trust = 1 / (1 + (misfit / max(2 * float(np.median(misfit)), np.finfo(float).tiny)) ** 2)
        if (lever**2).sum() <= 0:
            break
        cross = (trust * lever) @ rest / (trust * lever**2).sum()
    return np.degrees(np.where(angle < -np.pi / 4, angle + np.pi, angle))


def _main_gradient(tensor: FloatArray) -> FloatArray:
    """(x, y) gradient of stripes that all run alike."""
    values, vectors = np.linalg.eigh(np.array([[tensor[0], tensor[1]], [tensor[1], tensor[2]]]))
    return np.asarray(vectors[:, 1] * np.sqrt(max(float(values[1]), 0.0)))


def _cross_tensor(first: FloatArray, second: FloatArray, sense: int) -> FloatArray:
    """J× of even gradients; those are known but for their signs, which ``sense`` settles."""
    cross = np.array([first[0] * second[0], (first[0] * second[1] + first[1] * second[0]) / 2, first[1] * second[1]])
    return np.asarray(cross * (sense if cross[1] >= 0 else -sense))
