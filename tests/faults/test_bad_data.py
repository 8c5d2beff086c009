"""Bad data is a result: the rows that need it are rejected with a reason, the others finish, exit status 0."""

from __future__ import annotations

import shutil
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from rahas.stores.video_writer import Encoding, write_frames
from rahas.typing import ByteArray
from tests.workflow.expedition import ROWS, Expedition, Run, assert_whole, row, write_target

BEYOND_REJECTION = ("phase.zarr", "cloud.zarr", "cloud.ply", "calibration.json")
WIDTH, HEIGHT, FRAMES = 360, 240, 180
BAD_ROWS = (
    row("cut", capture="cut.mkv"),
    row("flipped", capture="flipped.mkv"),
    row("text", capture="text.mp4"),
    row("empty"),
    row("missing", capture="day 2/missing.mkv"),
    row("nowhere"),
    row("sheet", capture="sheet.avi"),
    row("photo", capture="photo.png"),
    row("still"),
    row("short"),
    row("hollow"),
    row("lying"),
    row("elsewhere", site="Nowhere", capture="rock.mkv"),
    row("uncalibrated", capture="rock.mkv", calibration="old"),
    row("colourless", capture="rock.mkv", texture="no such photo.jpg"),
    row("wordy", capture="rock.mkv", texture="text.mp4"),
)


def frames_of(capture: Path) -> ByteArray:
    with av.open(str(capture)) as container:
        return np.stack([frame.to_ndarray()[:HEIGHT, :WIDTH] for frame in container.decode(video=0)])


def bring_bad_captures(captures: Path) -> None:
    """What comes home from a wet season, beside the good captures."""
    whole = (captures / "rock.mkv").read_bytes()
    (captures / "cut.mkv").write_bytes(whole[: len(whole) * 6 // 10])
    hurt = bytearray(whole)
    rng = np.random.default_rng(5)
    for at in rng.integers(len(hurt) // 4, len(hurt) * 3 // 4, 40):
        hurt[at] ^= 1 << int(rng.integers(8))
    (captures / "flipped.mkv").write_bytes(hurt)
    (captures / "text.mp4").write_text("Dear diary, the river is high today.\n" * 50)
    (captures / "empty.mkv").write_bytes(b"")
    frame = np.tile(np.linspace(20, 220, WIDTH).astype(np.uint8), (HEIGHT, 1))
    write_frames(captures / "sheet.avi", [frame] * 4, Encoding("mjpeg"))
    sheet = bytearray((captures / "sheet.avi").read_bytes())
    start = sheet.find(b"\xff\xc0")
    while start >= 0:  # each picture's own header
        sheet[start + 5 : start + 9] = (16000).to_bytes(2, "big") * 2
        start = sheet.find(b"\xff\xc0", start + 9)
    (captures / "sheet.avi").write_bytes(sheet)
    cv2.imwrite(str(captures / "photo.png"), frame)
    write_frames(captures / "still.mkv", [frame] * 60, Encoding("ffv1"))
    write_frames(captures / "short.mkv", [frame] * 2, Encoding("ffv1"))
    (captures / "hollow").mkdir()
    (captures / "lying").mkdir()
    for n in range(5):
        (captures / "lying" / f"{n}.png").write_text("no picture")


@pytest.fixture(scope="module")
def outcome(first_run: tuple[Expedition, Run], tmp_path_factory: pytest.TempPathFactory) -> tuple[Expedition, Run]:
    """The processed expedition with all the bad rows, run once."""
    expedition = first_run[0].copy(tmp_path_factory.mktemp("bad") / "expedition")
    bring_bad_captures(expedition.root / "captures")
    old = row("old", role="calibration", site="Elsewhere", decision="reject")
    expedition.log([*ROWS, old, *BAD_ROWS])
    return expedition, expedition.run()


@pytest.mark.parametrize(
    ("scan_id", "rules", "told"),
    [
        ("cut", {"damaged", "unreadable", "timeline"}, ""),
        ("flipped", {"damaged", "unreadable", "timeline"}, ""),
        ("text", {"unreadable"}, "text.mp4"),
        ("empty", {"unreadable"}, "empty.mkv"),
        ("missing", {"unreadable"}, "missing.mkv"),
        ("nowhere", {"unreadable"}, "nowhere"),
        ("sheet", {"unreadable"}, ""),
        ("photo", {"unreadable", "timeline"}, ""),
        ("still", {"timeline"}, ""),
        ("short", {"unreadable", "timeline"}, ""),
        ("hollow", {"unreadable"}, "hollow"),
        ("lying", {"unreadable"}, ""),
        ("elsewhere", {"calibration"}, "calibration"),
        ("uncalibrated", {"calibration"}, "old"),
        ("colourless", {"unreadable"}, "no such photo.jpg"),
        ("wordy", {"unreadable"}, "text.mp4"),
    ],
)
def test_bad_row_is_rejected(outcome: tuple[Expedition, Run], scan_id: str, rules: set[str], told: str) -> None:
    expedition, run = outcome
    qa = expedition.qa(scan_id)
    assert qa["verdict"] == "rejected", qa
    assert {reason["rule"] for reason in qa["reasons"]} <= rules, qa["reasons"]
    message = qa["reasons"][0]["message"]
    assert told in message
    assert len(message) > 40, "a sentence that says what to do"
    assert not [name for name in BEYOND_REJECTION if (expedition.scan(scan_id) / name).exists()]
    assert (expedition.scan(scan_id) / "report.html").exists()
    assert expedition.table()[scan_id]["message"]
    assert any(line.split()[:2] == [scan_id, "rejected"] for line in run.output.splitlines())


def test_others_are_not_hurt(outcome: tuple[Expedition, Run]) -> None:
    expedition, run = outcome
    assert run.status == 0, run.output
    assert "Traceback" not in run.output
    assert run.started == {"old", *(cells["scan_id"] for cells in BAD_ROWS)}
    assert [expedition.verdict(s) for s in ("cal", "rock")] == ["accepted", "accepted"]
    assert expedition.verdict("old") == "not_processed: operator"
    assert (expedition.scan("rock") / "cloud.ply").exists()
    assert_whole(expedition.root / "results")


def test_bad_row_is_not_tried_again(outcome: tuple[Expedition, Run]) -> None:
    assert "Nothing to be done" in outcome[0].run().output


@pytest.mark.faults
def test_bad_row_mended(outcome: tuple[Expedition, Run], tmp_path: Path) -> None:
    """The right file copied to its place is all that it takes, and back again takes all away."""
    expedition = outcome[0].copy(tmp_path / "expedition")
    capture = expedition.root / "captures" / "empty.mkv"
    shutil.copyfile(expedition.root / "captures" / "rock.mkv", capture)
    run = expedition.run()
    assert run.status == 0, run.output
    assert run.started == {"empty"}
    assert expedition.verdict("empty") == "accepted"
    assert (expedition.scan("empty") / "cloud.ply").exists()
    capture.write_bytes(b"")
    run = expedition.run()
    assert (run.status, run.made) == (0, []), run.output
    assert expedition.verdict("empty") == "rejected: unreadable"
    left = {path.name for path in expedition.scan("empty").iterdir()} - {"review"}
    assert left == {"qa.json", "report.html", "figures", "provenance"}
    assert_whole(expedition.root / "results")


@pytest.mark.parametrize(
    "how",
    ["17 marks", *(pytest.param(how, marks=pytest.mark.faults) for how in ("missing", "garbage", "a mark moved"))],
)
def test_wrong_target(finished: Expedition, how: str) -> None:
    """Calibration and the scans that use it are rejected; with the right table all is as before."""
    target = finished.root / "config" / "target.csv"
    before, digests = target.read_bytes(), finished.digests()
    if how == "missing":
        target.unlink()
    elif how == "17 marks":
        write_target(target, marks=17)
    elif how == "garbage":
        target.write_bytes(b"\x00\xff\x13PK" * 30)
    else:
        target.write_bytes(before.replace(b"\n5,33.3786", b"\n5,13.3786"))
    run = finished.run()
    assert run.status == 0, run.output
    assert (finished.verdict("cal"), finished.verdict("rock")) == ("rejected: calibration", "rejected: calibration")
    assert "target" in finished.qa("cal")["reasons"][0]["message"]
    assert "cal" in finished.qa("rock")["reasons"][0]["message"]
    for path in ("cal/calibration.json", "cal/phase.zarr", "rock/cloud.ply", "rock/cloud.zarr", "rock/phase.zarr"):
        assert not (finished.root / "results" / path).exists()
    target.write_bytes(before)
    assert finished.run().status == 0
    after = finished.digests()
    assert {n for n in digests if digests[n] != after.get(n) and "/provenance/" not in n} == set()


@pytest.mark.faults
def test_folder_of_stills(finished: Expedition) -> None:
    """PNGs of the frames give the very cloud that the lossless video gave."""
    frames = frames_of(finished.root / "captures" / "rock.mkv")
    assert len(frames) == FRAMES
    write_frames(finished.root / "captures" / "stills", iter(frames), Encoding("png"))
    finished.log([*ROWS, row("stills", texture="rock_texture.png")])
    run = finished.run()
    assert run.status == 0, run.output
    assert finished.verdict("stills") == "accepted"
    bodies = [(finished.scan(s) / "cloud.ply").read_bytes().partition(b"end_header\n")[2] for s in ("rock", "stills")]
    assert bodies[0] == bodies[1]


def test_hopeless_capture_let_through(finished: Expedition) -> None:
    """What the operator asks for all the same may still be rejected, where it cannot be done; it is no failure."""
    run = finished.run("--config", "include_rejected=far")
    assert run.status == 0, run.output
    assert finished.verdict("far").startswith(("accepted: ", "rejected: "))
    assert "include_rejected" in (finished.scan("far") / "report.html").read_text(encoding="utf-8")


def test_turned_capture_gets_a_verdict(finished: Expedition) -> None:
    """A camera mounted on its side: the baseline is not vertical in the image, so the result cannot be trusted."""
    frames = frames_of(finished.root / "captures" / "rock.mkv")
    turned = (np.ascontiguousarray(frame.T) for frame in frames)
    write_frames(finished.root / "captures" / "turned.mkv", turned, Encoding("ffv1"))
    finished.log([*ROWS, row("turned")])
    run = finished.run()
    assert run.status == 0, run.output
    assert finished.verdict("turned").startswith("rejected: ")
