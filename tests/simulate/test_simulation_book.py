"""The embedded expedition: the simulation book, the field log and the target agree, and re-enact what they say."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import yaml

from rahas.errors import ExpeditionError
from rahas.simulate.book import SimulationBook
from rahas.simulate.hand import motion_of
from rahas.simulate.maps import surface_of
from rahas.simulate.roof import DIAMETER_MM, target_marks
from rahas.simulate.surface import ALBEDO_SPACING_MM
from rahas.stores.video_writer import SUFFIXES
from rahas.tasks import simulate
from rahas.tasks.book import check_book

ROOT = Path(__file__).parents[2]
BOOK_PATH = ROOT / "config" / "simulation.yaml"


@pytest.fixture(scope="module")
def book() -> SimulationBook:
    return SimulationBook.model_validate(yaml.safe_load(BOOK_PATH.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def log() -> list[dict[str, str]]:
    with (ROOT / "field_log.csv").open(encoding="utf-8", newline="") as handle:
        return list(csv.DictReader(handle))


def worst_jitter(book: SimulationBook, scan_id: str) -> float:
    """Largest rms displacement about its mean in any second from the rotation to the scan's end, px."""
    capture = book.capture(scan_id)
    hand, motion = capture.hand, motion_of(capture.hand, capture.rig, centre_v=0.0, seed=capture.seed)
    start = hand.dark_before_s + hand.hold_before_s
    end = start + hand.rotation_s + hand.hold_between_s + hand.crank_s
    times = np.arange(start, end, 1 / capture.camera.frame_rate)
    x, y = motion.at("jitter_x", times), motion.at("jitter_y", times)
    return max(float(np.hypot(x[n : n + 30].std(), y[n : n + 30].std())) for n in range(len(times) - 29))


def test_every_row_of_the_log_is_in_the_book_and_its_files_are_named_as_they_are_made(book, log):
    assert [row["scan_id"] for row in log] == list(book.captures)
    for row in log:
        suffix = SUFFIXES[book.capture(row["scan_id"]).encoding.codec]
        assert row["capture"] == f"simulated/{row['scan_id']}{suffix}"
        assert row["texture"] == f"simulated/{row['scan_id']}_texture.png"
        assert (book.capture(row["scan_id"]).scene.kind == "roof") == (row["role"] == "calibration")


def test_the_journey_is_the_theses(book, log):
    rows = {row["scan_id"]: row for row in log}
    assert {row["site"] for row in log} == {"The Cave on Cave Creek", "Los Metates", "Walpaulban Tara"}
    repeated = [row for row in log if row["redundant_of"] and row["site"] == "Walpaulban Tara"]
    assert len(repeated) == 2
    assert [row["scan_id"] for row in log if row["decision"] == "reject"] == ["river_1b"]
    for scan_id, row in rows.items():
        expected = book.captures[scan_id].expected
        assert expected == {"The Cave on Cave Creek": "rejected", "Los Metates": "rejected"}.get(
            row["site"] if row["role"] == "scan" else "", "not_processed" if row["decision"] == "reject" else "accepted"
        )


def test_only_the_cave_was_jarred(book):
    for scan_id, page in book.captures.items():
        jitter = worst_jitter(book, scan_id)
        assert 2.0 < jitter < 4.5 if page.expected_rule == "jitter" else jitter < 0.1


def test_the_stones_of_los_metates_span_a_fifth_and_that_of_the_cave_most_of_the_picture(book):
    for scan_id, least, most in (("hill_1", 0.17, 0.23), ("cave_1", 0.8, 0.97)):
        capture = book.capture(scan_id)
        columns = np.flatnonzero((surface_of(capture).albedo > 0.1).any(axis=0))
        view_mm = capture.rig.working_distance_mm / capture.rig.focal_widths
        assert least < np.ptp(columns) * ALBEDO_SPACING_MM / view_mm < most


def test_target_table_is_the_roof_that_is_rendered():
    table = np.loadtxt(ROOT / "config" / "target.csv", delimiter=",", skiprows=1)
    assert np.array_equal(table[:, 0], np.arange(1, 19))
    assert np.abs(table[:, 1:4] - target_marks()).max() < 1e-4
    assert np.all(table[:, 4] == DIAMETER_MM)


SMALL_BOOK = """
setups:
  bench: {rig: {width_px: 96, height_px: 64, stripes: 8}}
captures:
  one:
    setup: bench
    scene: {kind: circle, size_mm: 170}
    hand:
      {dark_before_s: 0.1, hold_before_s: 0.1, rotation_s: 0.3, hold_between_s: 0.1, crank_s: 0.3, hold_after_s: 0.1,
       dark_after_s: 0}
    encoding: {codec: mpeg2}
"""


def test_task_writes_video_photo_and_truth_the_same_every_time(tmp_path):
    (tmp_path / "simulation.yaml").write_text(SMALL_BOOK, encoding="utf-8")
    made = []
    for name in ("a", "b"):
        simulate.run(spec_path=tmp_path / "simulation.yaml", scan_id="one", captures=tmp_path / name)
        files = sorted((tmp_path / name / "simulated").iterdir())
        assert [f.name for f in files] == ["one.mpg", "one_texture.png", "one_truth.npz"]
        made.append([f.read_bytes() for f in files])
    assert made[0] == made[1]
    with np.load(tmp_path / "a" / "simulated" / "one_truth.npz") as truth:
        assert truth["world_target"].shape == (64, 96, 3)
        assert truth["world_target"].dtype == np.float32
        assert len(truth["theta"]) == 30


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("scene: {kind: circle", "scene: {kind: cube", "captures.one.scene.kind"),
        ("setup: bench", "setup: sofa", "sofa"),
        ("codec: mpeg2}", "codec: mpeg2, bitrate: 3}", "captures.one.encoding.bitrate"),
        ("  one:", "  two:", "'one'"),
        ("setups:", "setups: [", "line"),
    ],
)
def test_a_wrong_book_is_refused_with_the_place(tmp_path, old, new, told):
    (tmp_path / "simulation.yaml").write_text(SMALL_BOOK.replace(old, new), encoding="utf-8")
    with pytest.raises(ExpeditionError, match=r"simulation\.yaml") as refusal:
        simulate.run(spec_path=tmp_path / "simulation.yaml", scan_id="one", captures=tmp_path)
    assert told in str(refusal.value)
    assert not (tmp_path / "simulated").exists()


def test_a_missing_book_is_told(tmp_path):
    with pytest.raises(ExpeditionError, match="no such file"):
        simulate.run(spec_path=tmp_path / "simulation.yaml", scan_id="one", captures=tmp_path)


def test_all_rows_that_the_book_lacks_are_told_at_once(tmp_path):
    (tmp_path / "simulation.yaml").write_text(SMALL_BOOK, encoding="utf-8")
    check_book(tmp_path / "simulation.yaml", ["one"])
    check_book(tmp_path / "no such book.yaml", [])
    with pytest.raises(ExpeditionError) as refusal:
        check_book(tmp_path / "simulation.yaml", ["one", "two", "three"])
    assert [line.partition("read no ")[2][:7] for line in str(refusal.value).splitlines()] == ["'two', ", "'three'"]
    with pytest.raises(ExpeditionError, match="no such file, expected it because one is to be rendered"):
        check_book(tmp_path / "no such book.yaml", ["one"])
