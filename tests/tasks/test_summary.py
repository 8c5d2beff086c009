"""The expedition at a glance: every row of the log is there, finished or not, in page, table and terminal."""

from __future__ import annotations

import csv
import os
import re
from pathlib import Path
from typing import Any

import pytest

from rahas.stores.atomic import write_json, write_text
from rahas.stores.field_log import Entry
from rahas.tasks import summary

REASON = {"rule": "jitter", "metric": "jitter", "value": 3.4, "limit": 1.0, "unit": "px", "message": "The rig shook."}
OTHER = {"rule": "object_span", "metric": "object_span", "value": 0.2, "limit": 0.5, "unit": "", "message": "Too far."}


def entry(scan_id: str, **changes: Any) -> Entry:
    cells: dict[str, Any] = {
        "scan_id": scan_id, "site": "Tara", "notes": "", "decision": "keep", "role": "scan", "calibration": None,
        "capture": None, "texture": None, "texture_named": False, "subject": "stone", "date": "", "time": "",
        "operator": "", "redundant_of": None, "extra": {}, "line": 2, "simulated": False,
    }  # fmt: skip
    return Entry(**(cells | changes))


def finish(results: Path, scan_id: str, verdict: str, **changes: Any) -> None:
    qa = {"scan_id": scan_id, "verdict": verdict, "reasons": [], "warnings": [], "metrics": {}, "decision": "keep"}
    write_json(results / scan_id / "qa.json", qa | changes)
    write_text(results / scan_id / "report.html", "a page")


@pytest.fixture
def results(tmp_path: Path) -> Path:
    folder = tmp_path / "results"
    finish(folder, "good", "accepted", metrics={"jitter": 0.123456789012345, "zeta": 3, "object_span": None})
    finish(folder, "shaken", "rejected", reasons=[REASON, OTHER], metrics={"jitter": 3.4, "object_span": 0.2})
    finish(folder, "left", "not_processed", reasons=[{**REASON, "rule": "operator", "message": "Left out."}])
    write_text(folder / "good" / "figures" / "thumbnail.jpg", "a picture")
    return folder


ENTRIES = [
    entry("good"),
    entry("shaken", site="Cave, Creek"),
    entry("left", decision="reject"),
    entry("broken", decision="", site="Cave, Creek"),
]


def rows_of(results: Path) -> list[dict[str, str]]:
    with open(results / "scans.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_the_table_has_a_row_for_each_row_of_the_log_in_its_order(results: Path) -> None:
    summary.run(results, ENTRIES)
    rows = rows_of(results)
    assert [row["scan_id"] for row in rows] == ["good", "shaken", "left", "broken"]
    assert [row["verdict"] for row in rows] == ["accepted", "rejected", "not_processed", ""]
    assert [row["decision"] for row in rows] == ["keep", "keep", "reject", ""]
    assert rows[1]["site"] == "Cave, Creek"
    assert (rows[1]["rule"], rows[1]["message"]) == ("jitter; object_span", "The rig shook.; Too far.")
    assert list(rows[0])[7:] == ["object_span", "jitter", "zeta"]
    assert float(rows[0]["jitter"]) == 0.123456789012345
    assert (rows[0]["object_span"], rows[0]["zeta"], rows[3]["jitter"]) == ("", "3", "")


def test_the_closing_lines_count_and_say_why(results: Path) -> None:
    lines = summary.run(results, ENTRIES).splitlines()
    assert lines[0] == "4 captures: 1 accepted, 1 rejected, 1 not processed, 1 not finished"
    shaken = next(line for line in lines if "shaken" in line)
    assert "rejected" in shaken
    assert "jitter: The rig shook.; object_span: Too far." in shaken
    assert any("broken" in line and "not finished" in line for line in lines)
    assert not any(line.strip().startswith("good") for line in lines)


def test_no_unfinished_row_no_word_of_it(results: Path) -> None:
    assert "not finished" not in summary.run(results, ENTRIES[:3])


def test_a_reason_cannot_steer_the_terminal(results: Path) -> None:
    finish(results, "broken", "rejected", reasons=[{**REASON, "message": "file \x1b[2J\x07\nis\r\tbad"}])
    text = summary.run(results, ENTRIES)
    assert all(c.isprintable() or c == "\n" for c in text)
    assert "file [2J is bad" in text


def test_a_scan_let_through_is_told_everywhere(results: Path) -> None:
    finish(results, "shaken", "accepted", warnings=[{**REASON, "waived": True}], overridden=True)
    text = summary.run(results, ENTRIES)
    assert "let through by include_rejected; jitter: The rig shook." in text
    assert "let through" in (results / "index.html").read_text(encoding="utf-8")
    row = rows_of(results)[1]
    assert (row["verdict"], row["rule"], row["message"]) == ("accepted", "jitter", "Let through: The rig shook.")


def test_the_index_links_only_what_is_there(results: Path) -> None:
    summary.run(results, ENTRIES)
    page = (results / "index.html").read_text(encoding="utf-8")
    links = [part.split('"')[0] for key in ('href="', 'src="') for part in page.split(key)[1:]]
    assert {"good/report.html", "good/figures/thumbnail.jpg", "scans.csv", "left/report.html"} <= set(links)
    assert [link for link in links if not (results / link).exists()] == []
    assert "broken" in page
    assert page.index("Tara") < page.index("Cave, Creek")


def test_what_people_typed_cannot_become_markup(results: Path) -> None:
    summary.run(results, [entry("good", site="<b>x</b>", subject="<script>1</script>", date='"><i>')])
    page = (results / "index.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "<b>x" not in page
    assert "<i>" not in page
    assert "&lt;script&gt;" in page


def test_an_empty_log_is_no_accident(tmp_path: Path) -> None:
    assert summary.run(tmp_path / "results", []).startswith("0 captures: 0 accepted")
    assert (tmp_path / "results" / "index.html").is_file()


def test_the_same_results_give_the_same_bytes(results: Path) -> None:
    summary.run(results, ENTRIES)
    before = [(results / name).read_bytes() for name in ("index.html", "scans.csv")]
    summary.run(results, ENTRIES)
    assert [(results / name).read_bytes() for name in ("index.html", "scans.csv")] == before


def test_what_killed_jobs_left_is_swept(results: Path) -> None:
    """Below results/ and among the rendered captures; not what is only named alike."""
    machine = re.sub(r"[^A-Za-z0-9.]", "_", os.uname().nodename)
    folders = (results, results / "expedition" / "provenance", results.parent / "captures" / "simulated")
    left = [folder / f".making-{machine}-{2**22 + 1}-abc" for folder in folders]
    for path in left:
        path.mkdir(parents=True)
        (path / "half").write_text("")
    (results.parent / "captures" / "simulated" / "rock.mkv").write_text("kept")
    summary.run(results, ENTRIES)
    assert not [path for path in left if path.exists()]
    assert (results.parent / "captures" / "simulated" / "rock.mkv").exists()
