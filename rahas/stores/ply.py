"""Clouds as binary PLY that CloudCompare and MeshLab open, scalars included."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rahas.stores.atomic import replacing
from rahas.typing import AnyArray, BoolArray, ByteArray, Float32Array

_ROWS = 128
"""Of the grid, written at a time."""


def write_cloud(
    path: Path,
    points: Float32Array,
    *,
    mask: BoolArray,
    normals: Float32Array,
    colour: ByteArray,
    scalars: Mapping[str, AnyArray],
    comment: str = "",
) -> None:
    """Write the points (y, x, 3) where ``mask`` (y, x) holds, row by row: x y z nx ny nz red green blue scalar_….

    ``scalars`` (y, x) are written as float under ``scalar_<name>``; a missing value is 0, as readers stumble over NaN.
    """
    names = ["x", "y", "z", "nx", "ny", "nz"]
    fields: list[tuple[str, str]] = [(name, "<f4") for name in names]
    fields += [(name, "u1") for name in ("red", "green", "blue")]
    fields += [(f"scalar_{name}", "<f4") for name in scalars]

    def rows(part: slice) -> AnyArray:
        inside = mask[part]
        table = np.zeros(int(inside.sum()), dtype=np.dtype(fields))
        for index, name in enumerate("xyz"):
            table[name] = points[part][..., index][inside]
            table[f"n{name}"] = normals[part][..., index][inside]
        for index, name in enumerate(("red", "green", "blue")):
            table[name] = colour[part][..., index][inside]
        for name, values in scalars.items():
            table[f"scalar_{name}"] = np.nan_to_num(values[part][inside], nan=0.0, posinf=0.0, neginf=0.0)
        return table

    kinds = {"<f4": "float", "u1": "uchar"}
    header = ["ply", "format binary_little_endian 1.0"]
    header += [
        f"comment {' '.join(line.split()).replace('end_header', 'end-header')}"
        for line in comment.splitlines()
        if line.strip()
    ]
    header += [f"element vertex {int(mask.sum())}"]
    header += [f"property {kinds[kind]} {name}" for name, kind in fields]
    header += ["end_header", ""]
    with replacing(path) as temporary, open(temporary, "wb") as handle:
        handle.write("\n".join(header).encode("ascii", "replace"))
        for first in range(0, len(mask), _ROWS):
            handle.write(rows(slice(first, first + _ROWS)).tobytes())
