"""Render one capture of config/simulation.yaml: video, texture photo and ground truth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from rahas.simulate.capture import photo, stage
from rahas.simulate.specs import CaptureSpec
from rahas.stores.atomic import replacing
from rahas.stores.video_writer import SUFFIXES, Encoding, write_frames
from rahas.tasks.book import read_capture_spec


def run(*, spec_path: Path, scan_id: str, captures: Path) -> None:
    """Write captures/simulated/<scan_id>.<mkv, mp4, mpg, avi, or a folder>, …_texture.png and …_truth.npz.

    Each appears whole or not at all, the video last. Equal specifications give equal bytes.

    Raises
    ------
    ExpeditionError
        There is no such file, it is no simulation book, or it does not hold the capture.
    """
    cv2.setNumThreads(1)
    staged = stage(read_capture_spec(spec_path, scan_id))
    capture, folder = staged.capture, captures / "simulated"
    with replacing(folder / f"{scan_id}_truth.npz") as temporary:
        np.savez_compressed(temporary, **staged.truth())  # type: ignore[arg-type]
    with replacing(folder / f"{scan_id}_texture.png") as temporary:
        if not cv2.imwrite(str(temporary), photo(staged)[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 1]):
            raise OSError(f"{temporary.name} could not be written")
    encoding = encoding_of(capture)
    write_frames(folder / (scan_id + SUFFIXES[encoding.codec]), staged.frames(), encoding)


def encoding_of(capture: CaptureSpec) -> Encoding:
    """How the capture's film is written."""
    return Encoding(
        codec=capture.encoding.codec,
        frame_rate=capture.camera.frame_rate,
        fields=capture.camera.fields,
        full_range=capture.camera.luma_range == "full",
        crf=capture.encoding.crf,
        quantiser=capture.encoding.quantiser,
    )
