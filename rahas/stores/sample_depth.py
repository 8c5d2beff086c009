"""How many bits of 16-bit samples a camera filled: files of 10, 12 and 14-bit sensors are written with 16.

Samples stand in the upper bits (then the lower ones are 0 everywhere) or in the lower ones. The latter shows only
where something is saturated: the largest code of all, one of these sensors' top codes, is then there again and again.
Where nothing is, 16 bits are as good as any.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from rahas.typing import AnyArray

_SENSOR_BITS = (10, 12, 14)
_REPEATED = 20  # samples at the largest code


class SampleDepth(NamedTuple):
    """Where the samples stand in their words."""

    bits: int
    """Of a sample, once it is shifted; its top code is 2**bits - 1."""
    shift: int
    """To the right, that brings the lowest bit that is used to the end."""


def depth_of_samples(pictures: Iterable[AnyArray]) -> SampleDepth:
    """Depth of uint16 ``pictures`` of any shape, bright ones among them.

    >>> depth_of_samples([np.array([0, 16, 4080 << 4], np.uint16)])
    SampleDepth(bits=12, shift=4)
    """
    used, largest, count = 0, 0, 0
    for picture in pictures:
        used |= int(np.bitwise_or.reduce(picture, axis=None))
        top = int(picture.max())
        at_top = int(np.count_nonzero(picture == top))
        if top > largest:
            largest, count = top, at_top
        elif top == largest:
            count += at_top
    if not used:
        return SampleDepth(16, 0)
    shift = (used & -used).bit_length() - 1
    shift = shift if 16 - shift in _SENSOR_BITS else 0
    for bits in _SENSOR_BITS:
        if largest >> shift == 2**bits - 1 and count >= _REPEATED:
            return SampleDepth(bits, shift)
    return SampleDepth(16 - shift, shift)
