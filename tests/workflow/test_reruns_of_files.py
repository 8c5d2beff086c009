"""A replaced file or library runs what depends on its content, and no more than that; the page says the same."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from rahas.params import IngestParams
from rahas.stores.capture import open_capture
from rahas.stores.video_writer import Encoding, write_frames
from rahas.typing import ByteArray
from tests.workflow.expedition import NOTHING, Expedition
from tests.workflow.rerun_table import PAGE, table
from tests.workflow.reruns import RERUNS, assert_runs

RECORDS = {"provenance", "history"}
VOID = b"\xec\x84rest"  # an EBML element that every reader skips


def edited_frames(path: Path) -> Iterator[ByteArray]:
    """The frames of a capture, darker by one grey level."""
    for frame in list(open_capture(path, IngestParams()).frames()):
        yield np.asarray(frame - (frame > 16), dtype=np.uint8)


def changed(expedition: Expedition, before: dict[str, str]) -> set[str]:
    """Artifacts whose bytes are others, or that are gone."""
    after = expedition.digests()
    return {name for name in before if before[name] != after.get(name) and not RECORDS & set(name.split("/"))}


def assert_only_changed(expedition: Expedition, before: dict[str, str], *scans: str) -> None:
    assert {name.split("/")[0] for name in changed(expedition, before)} - {"index.html", "scans.csv"} == set(scans)


def test_capture_replaced(finished: Expedition) -> None:
    """Other frames: its own scan and nothing else."""
    before = finished.digests()
    capture = finished.root / "captures" / "far.mkv"
    write_frames(capture, edited_frames(capture), Encoding("ffv1"))
    assert_runs("capture replaced", finished.run())
    assert finished.verdict("far") == "rejected: object_span"
    assert_only_changed(finished, before, "far")


def test_same_frames_in_another_file(finished: Expedition) -> None:
    """The new store is byte for byte the old, so nothing that follows is computed."""
    before = finished.digests()
    with open(finished.root / "captures" / "rock.mkv", "ab") as file:
        file.write(VOID)
    assert_runs("capture, same frames", finished.run())
    assert changed(finished, before) == set()
    assert NOTHING in finished.run().output


def test_photo_of_the_calibration_replaced(finished: Expedition) -> None:
    """The calibration and what uses it."""
    before = finished.digests()
    photo = finished.root / "captures" / "cal_texture.png"
    image = cv2.imread(str(photo))
    assert image is not None
    cv2.imwrite(str(photo), cv2.GaussianBlur(image, (5, 5), 1.0))
    assert_runs("calibration's photo replaced", finished.run())
    assert_only_changed(finished, before, "cal", "rock")


@pytest.mark.faults
def test_capture_of_the_calibration_replaced(finished: Expedition) -> None:
    before = finished.digests()
    capture = finished.root / "captures" / "cal.mkv"
    write_frames(capture, edited_frames(capture), Encoding("ffv1"))
    assert_runs("calibration's capture replaced", finished.run())
    assert_only_changed(finished, before, "cal", "rock")


def test_library_of_another_version(finished: Expedition, tmp_path: Path) -> None:
    """Announced before anything runs; stages that name the library are computed, and stop where bytes stay equal."""
    installed = tmp_path / "newer" / "pillow-99.1.dist-info"
    installed.mkdir(parents=True)
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: pillow\nVersion: 99.1\n")
    before = finished.digests()
    dry = finished.run("--dry-run", environment={"PYTHONPATH": str(installed.parent)})
    run = finished.run(environment={"PYTHONPATH": str(installed.parent)})
    assert_runs("library", run)
    for one in (dry, run):
        [told] = one.announced
        assert re.fullmatch(
            r"library pillow: [\d.]+ → 99\.1: ingest, calibrate, cloud of 3 scans no longer current", told
        )
    assert changed(finished, before) == set()


def test_page() -> None:
    assert PAGE.read_text(encoding="utf-8") == table(), "python -m tests.workflow.rerun_table --write"


def test_every_line_of_the_page_is_asserted() -> None:
    """Each declared change is asserted by a test of this folder, by its name."""
    sources = "".join(path.read_text(encoding="utf-8") for path in Path(__file__).parent.glob("test_*.py"))
    asserted = set(re.findall(r'assert_runs\("([^"]+)"', sources))
    assert asserted == set(RERUNS)
