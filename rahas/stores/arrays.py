"""Zarr stores: every chunk carries a checksum, and a manifest written last lists what belongs to the store.

A zarr store with a missing chunk reads as zeros without a word; so a store without its manifest is refused, and
the manifest names each file with its digest, for the audit.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.codecs import BloscCodec, Crc32cCodec

from rahas.stores.atomic import replacing
from rahas.stores.digests import MANIFEST_NAME, manifest_of_folder

# As many threads as a machine has cores would each hold chunks of their own: memory of a job is to be bounded.
zarr.config.set({"threading.max_workers": 2, "async.concurrency": 4})


class StoreIncomplete(Exception):
    """The store's writer did not finish, or the manifest is gone."""


class StoreWriter:
    """A zarr group being written; arrays are created with named dimensions, units and checksummed chunks."""

    def __init__(self, group: zarr.Group) -> None:
        self._group = group

    def create(
        self,
        name: str,
        dims: Sequence[str],
        shape: Sequence[int],
        dtype: Any,
        *,
        chunks: Sequence[int] | None = None,
        shards: Sequence[int] | None = None,
        fill_value: Any = 0,
        **attributes: Any,
    ) -> zarr.Array:
        """Create an array to be filled; ``attributes`` should hold ``long_name`` and ``units``."""
        return self._group.create_array(
            name,
            shape=tuple(shape),
            dtype=dtype,
            chunks=tuple(chunks) if chunks else tuple(max(1, n) for n in shape),
            shards=tuple(shards) if shards else None,
            compressors=[BloscCodec(cname="lz4", clevel=5, shuffle="bitshuffle"), Crc32cCodec()],
            fill_value=fill_value,
            dimension_names=list(dims),
            attributes=attributes,
        )

    def put(
        self,
        name: str,
        dims: Sequence[str],
        values: Any,
        *,
        chunks: Sequence[int] | None = None,
        shards: Sequence[int] | None = None,
        **attributes: Any,
    ) -> None:
        """Create an array holding ``values``."""
        values = np.asarray(values)
        array = self.create(name, dims, values.shape, values.dtype, chunks=chunks, shards=shards, **attributes)
        array[...] = values

    def set_attributes(self, attributes: Mapping[str, Any]) -> None:
        """Add attributes to the store itself."""
        self._group.attrs.update(dict(attributes))


@contextmanager
def writing_store(path: Path, **attributes: Any) -> Iterator[StoreWriter]:
    """Write a store: it appears under ``path`` with its manifest when the block ends well, else not at all."""
    with replacing(path) as temporary:
        group = zarr.open_group(store=str(temporary), mode="w", zarr_format=3, attributes=attributes)
        yield StoreWriter(group)
        with warnings.catch_warnings():  # it says that the v3 specification does not have this yet; xarray wants it
            warnings.simplefilter("ignore")
            zarr.consolidate_metadata(group.store)
        manifest = {"files": manifest_of_folder(temporary)}
        (temporary / MANIFEST_NAME).write_text(json.dumps(manifest, indent=0, sort_keys=True), encoding="utf-8")


def open_store(path: Path) -> zarr.Group:
    """Open a finished store for reading.

    Raises
    ------
    StoreIncomplete
        There is no manifest: the store was never finished.
    """
    if not (path / MANIFEST_NAME).is_file():
        raise StoreIncomplete(f"{path}: no {MANIFEST_NAME}, so the store is not whole; delete it and run again")
    return zarr.open_group(store=str(path), mode="r")
