"""Memory between the stages of a job."""

from __future__ import annotations

import ctypes
import gc
import sys


def give_back_memory() -> None:
    """Give what earlier stages have freed back to the machine; where its C library cannot, nothing happens.

    The GNU C library keeps freed memory for later, in pieces too small for the next stage's images: a job of two
    stages would take nearly what both take.
    """
    gc.collect()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
