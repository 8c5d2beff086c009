"""Captures filmed and processed once for all tests of the chain."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import pytest

from rahas.simulate.specs import CaptureSpec
from rahas.stores.layout import ScanFolder
from rahas.tasks.simulate import read_capture_spec
from tests.chain.bench import Processed, Truth, film, process, write_target

BOOK = Path(__file__).parents[2] / "config" / "simulation.yaml"


class River(NamedTuple):
    """The embedded expedition's set-up at the river: its calibration and a keeper, at full size."""

    root: Path
    calibration: Processed
    keeper: Processed
    captures: dict[str, CaptureSpec]
    truth: dict[str, Truth]
    """By scan_id: ``cal``, ``keeper``."""


@pytest.fixture(scope="session")
def river(tmp_path_factory: pytest.TempPathFactory) -> River:
    root = tmp_path_factory.mktemp("river")
    target = write_target(root / "target.csv")
    captures = {"cal": read_capture_spec(BOOK, "river_cal"), "keeper": read_capture_spec(BOOK, "river_1")}
    files, truth = {}, {}
    for scan_id, capture in captures.items():
        files[scan_id], truth[scan_id] = film(root / "captures", scan_id, capture, with_photo=True)
    scans = {scan_id: ScanFolder(root / "results", scan_id) for scan_id in captures}
    photos = {scan_id: root / "captures" / f"{scan_id}_texture.png" for scan_id in captures}
    calibration = process(scans["cal"], files["cal"], target=target, texture=photos["cal"])
    keeper = process(scans["keeper"], files["keeper"], calibration=scans["cal"], texture=photos["keeper"])
    return River(root, calibration, keeper, captures, truth)


@pytest.fixture(scope="session")
def extra_data() -> Path:
    """Folder of captures that are not part of the project."""
    folder = os.environ.get("RAHAS_EXTRA_DATA")
    if not folder:
        pytest.skip("RAHAS_EXTRA_DATA names no folder of captures that are kept outside the project")
    return Path(folder)
