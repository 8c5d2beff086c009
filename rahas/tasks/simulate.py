"""Render one capture of config/simulation.yaml: video, texture photo and ground truth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from pydantic import ValidationError

from rahas.errors import ExpeditionError
from rahas.simulate.book import SimulationBook
from rahas.simulate.capture import photo, stage
from rahas.simulate.specs import CaptureSpec
from rahas.stores.atomic import replacing
from rahas.stores.plain_yaml import PlainYamlError, parse_plain_yaml
from rahas.stores.video_writer import SUFFIXES, Encoding, write_frames


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


def read_capture_spec(spec_path: Path, scan_id: str) -> CaptureSpec:
    """The specification of one capture of a simulation book."""
    try:
        value, _ = parse_plain_yaml(spec_path.read_bytes())
        return SimulationBook.model_validate(value).capture(scan_id)
    except FileNotFoundError:
        raise ExpeditionError(f"{spec_path.name}: no such file, and {scan_id} is to be rendered from it") from None
    except PlainYamlError as error:
        raise ExpeditionError(f"{spec_path.name}{error}") from None
    except ValidationError as error:
        faults = [f"{'.'.join(map(str, e['loc']))}: read {e['input']!r:.80}, {e['msg']}" for e in error.errors()]
        raise ExpeditionError(f"{spec_path.name}: " + "; ".join(faults)) from None
    except ValueError as error:
        raise ExpeditionError(f"{spec_path.name}: {error}") from None
