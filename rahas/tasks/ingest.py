"""Ingest: a capture, as the camera left it, becomes a frame store."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from rahas.params import IngestParams
from rahas.stages.ahead import ahead
from rahas.stages.ingest import BlockMeasures, finish_thumbnails, join_measures, measure_block, thumbnail_scale
from rahas.stores.arrays import StoreWriter, writing_store
from rahas.stores.capture import Capture, open_capture
from rahas.stores.frames import GrowingArray, Spool, in_blocks
from rahas.stores.layout import ScanFolder
from rahas.typing import AnyArray

_STATISTICS = {
    "mean_level": ("mean level", "grey level"),
    "clipped_low_share": ("share of pixels at or below the black level", "1"),
    "clipped_high_share": ("share of pixels at or above the sensor's limit", "1"),
    "change": ("mean absolute difference from the frame before", "grey level"),
}


def run(scan: ScanFolder, *, capture: Path, params: IngestParams) -> None:
    """Decode ``capture`` once and write ``frames.zarr``.

    Raises
    ------
    CaptureProblem
        (rule ``unreadable``) The capture is missing or cannot be decoded.
    """
    source = open_capture(capture, params)
    with writing_store(scan.frames) as store, Spool(scan.path) as spool:
        _store_capture(source, store, spool)


def _store_capture(source: Capture, store: StoreWriter, spool: Spool) -> None:
    measures = []
    with GrowingArray(store, "frames", ("frame", "y", "x"), long_name="luma as shot", units="grey level") as frames:
        for measured in ahead(_measured, _stored(source, frames), depth=1):
            spool.append(measured.thumbnails)
            measures.append(measured._replace(thumbnails=measured.thumbnails[:, :0].copy()))  # a view would keep all
    facts = source.facts()
    whole = join_measures(
        measures, bit_depth=facts.bit_depth, luma_range=facts.luma_range, flagged_order=facts.flagged_order
    )
    store.put("time_s", ("frame",), facts.time_s, long_name="presentation time from the first frame on", units="s")
    for name, (long_name, units) in _STATISTICS.items():
        store.put(name, ("frame",), getattr(whole, name), long_name=long_name, units=units)
    scale = thumbnail_scale(facts.bit_depth)
    described = {
        "long_name": "mean over 4 x 4 pixels (interlaced: of the first field)",
        "units": f"grey level / {scale:g}",
    }
    with GrowingArray(store, "thumbnail", ("frame", "y_thumb", "x_thumb"), scale=scale, **described) as thumbnails:
        for halves in spool:
            thumbnails.append(finish_thumbnails(halves, whole.interlacing.field_order))
    store.set_attributes(
        {
            "frame_rate": facts.frame_rate,
            "codec": facts.codec,
            "bit_depth": facts.bit_depth,
            "interlaced": whole.interlacing.interlaced,
            "field_order": whole.interlacing.field_order,
            "flagged_field_order": facts.flagged_order,
            "luma_range": facts.luma_range,
            "clip_levels": list(whole.clip_levels),
            "damage": facts.damage,
            "declared_frames": facts.declared_frames,
        }
    )


class _Block(NamedTuple):
    frames: AnyArray
    before: AnyArray | None
    bit_depth: int


def _stored(source: Capture, frames: GrowingArray) -> Iterator[_Block]:
    """Decode, and give each block to the store; it is measured by a thread of its own."""
    last: AnyArray | None = None
    for block in in_blocks(source.frames()):
        frames.append(block)
        yield _Block(block, last, 8 if block.dtype.itemsize == 1 else source.bit_depth)
        last = block[-1]


def _measured(block: _Block) -> BlockMeasures:
    return measure_block(block.frames, block.before, bit_depth=block.bit_depth)
