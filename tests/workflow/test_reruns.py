"""An edit runs what depends on it, and nothing else: parameters, notes, limits, decisions, rows, code."""

from __future__ import annotations

import ast
import shutil

import numpy as np
import pytest
import xarray

from tests.workflow.expedition import NOTHING, ROWS, Expedition, Run, assert_whole, copy_code, edit, row
from tests.workflow.reruns import assert_runs

ARTIFACTS = ("phase.zarr", "cloud.zarr", "cloud.ply")


def limit_between_rock_and_calibration(expedition: Expedition) -> str:
    """A configuration that rejects ``rock`` at the first gate and not its calibration."""
    rock, cal = (expedition.qa(s)["metrics"]["contrast"] for s in ("rock", "cal"))
    assert rock < cal
    return f"capture_review:\n  min_contrast: {(rock + cal) / 2}\n"


def rows_with(scan_id: str, **cells: str) -> list[dict[str, str]]:
    """The log with some cells of one row changed."""
    return [dict(r) | (cells if r["scan_id"] == scan_id else {}) for r in ROWS]


def run_well(expedition: Expedition, *arguments: str) -> Run:
    run = expedition.run(*arguments)
    assert run.status == 0, run.output
    assert_whole(expedition.root / "results")
    return run


def assert_same_artifacts(before: dict[str, str], after: dict[str, str]) -> None:
    assert {n for n in before if before[n] != after.get(n) and "/provenance/" not in n} == set()


def test_parameter_of_one_stage(finished: Expedition) -> None:
    """Only the stage that reads it is computed, and what follows from its new bytes; then back."""
    before = finished.digests()
    finished.configure("cloud:\n  normal_radius_px: 3\n")
    run = run_well(finished)
    assert_runs("parameter", run)
    assert run.announced == ["parameter normal_radius_px: 2 → 3: cloud of 1 scan no longer current"]
    finished.configure("")
    assert run_well(finished).made == [("rock", "cloud"), ("rock", "review_result")]
    assert_same_artifacts(before, finished.digests())
    assert NOTHING in finished.run().output


@pytest.mark.faults
def test_swapped_values_are_seen(finished: Expedition) -> None:
    """Snakemake's own comparison of parameters is blind to this: the values of two keys change places."""
    finished.configure("result_review:\n  depth_step_spacings: 7.0\n  bridged_px: 9\n")
    assert run_well(finished).made == [("rock", "review_result")]
    finished.configure("result_review:\n  depth_step_spacings: 9.0\n  bridged_px: 7\n")
    assert run_well(finished).made == [("rock", "review_result")]


@pytest.mark.faults
def test_parameter_after_lost_metadata(finished: Expedition) -> None:
    shutil.rmtree(finished.root / ".snakemake")
    finished.configure("cloud:\n  normal_radius_px: 3\n")
    assert_runs("parameter, lost .snakemake", run_well(finished))


@pytest.mark.faults
def test_limit_without_effect(finished: Expedition) -> None:
    """The gate looks again, says the same, and nothing after it is computed."""
    finished.configure("capture_review:\n  max_jitter_px: 0.9\n")
    assert_runs("limit without effect", run_well(finished))


def test_limit_that_rejects(finished: Expedition) -> None:
    """The first gate takes everything away; asked for all the same, it is made and marked; then back."""
    before = finished.digests()
    finished.configure(limit_between_rock_and_calibration(finished))
    assert_runs("limit that rejects", run_well(finished))
    assert finished.verdict("rock") == "rejected: contrast"
    assert finished.verdict("cal") == "accepted"
    for name in (*ARTIFACTS, "snakes.zarr"):
        assert not (finished.scan("rock") / name).exists()

    run = run_well(finished, "--config", "include_rejected=rock")
    assert all((finished.scan("rock") / name).exists() for name in ARTIFACTS)
    assert "contrast" in finished.table()["rock"]["rule"] + finished.table()["rock"]["message"]
    assert "include_rejected" in (finished.scan("rock") / "report.html").read_text(encoding="utf-8")
    assert any(line.split()[:1] == ["rock"] and "include_rejected" in line for line in run.output.splitlines())

    assert run_well(finished).made == []
    assert finished.verdict("rock") == "rejected: contrast"
    assert not [name for name in (*ARTIFACTS, "snakes.zarr") if (finished.scan("rock") / name).exists()]
    finished.configure("")
    assert_runs("limit that lets through", run_well(finished))
    assert finished.verdict("rock") == "accepted"
    assert_same_artifacts(before, finished.digests())


@pytest.mark.faults
def test_late_limit_that_rejects(finished: Expedition) -> None:
    """The second gate takes phase and cloud away."""
    before = finished.digests()
    with xarray.open_zarr(finished.scan("rock") / "phase.zarr") as phase:
        limit = float(np.nanmedian(phase["phase_std"].values))
    finished.configure(f"cloud:\n  max_phase_std_rad: {limit}\nresult_review:\n  min_measured_share: 0.9\n")
    run = run_well(finished)
    assert run.made == [("rock", "cloud"), ("rock", "review_result")]
    assert finished.verdict("rock").startswith("rejected: ")
    assert not [name for name in ARTIFACTS if (finished.scan("rock") / name).exists()]
    assert NOTHING in finished.run().output
    asked = finished.run("results/rock/cloud.ply")
    assert asked.status != 0
    assert "measured" in asked.output
    finished.configure("")
    assert run_well(finished).made == [("rock", "cloud"), ("rock", "phase"), ("rock", "review_result")]
    assert_same_artifacts(before, finished.digests())


def test_note_edited(finished: Expedition) -> None:
    finished.log(rows_with("rock", notes="<script>alert('wet')</script>"))
    assert_runs("note", run_well(finished))
    page = (finished.scan("rock") / "report.html").read_text(encoding="utf-8")
    assert "wet" in page
    assert "<script>alert" not in page


@pytest.mark.faults
def test_decision_reject(finished: Expedition) -> None:
    before = finished.digests()
    finished.log(rows_with("rock", decision="reject"))
    assert_runs("rejected by the operator", run_well(finished))
    assert finished.verdict("rock") == "not_processed: operator"
    kept = {path.name for path in finished.scan("rock").iterdir()} - {"review"}
    assert kept == {"qa.json", "report.html", "figures", "provenance"}
    finished.log(ROWS)
    run_well(finished)
    assert_same_artifacts(before, finished.digests())


def test_calibration_rejected_by_the_operator(finished: Expedition) -> None:
    """The scans that use it are rejected with it, and come back with it."""
    before = finished.digests()
    finished.log(rows_with("cal", decision="reject"))
    run_well(finished)
    assert (finished.verdict("cal"), finished.verdict("rock")) == ("not_processed: operator", "rejected: calibration")
    assert not (finished.scan("rock") / "cloud.ply").exists()
    finished.log(ROWS)
    run_well(finished)
    assert_same_artifacts(before, finished.digests())


def test_new_row_and_removed_row(finished: Expedition) -> None:
    before = finished.digests()
    finished.log([*ROWS, row("far2", capture="far.mkv")])
    assert_runs("new row", run_well(finished))
    assert list(finished.table()) == ["cal", "rock", "far", "far2"]
    finished.log(ROWS)
    assert_runs("removed row", run_well(finished))
    assert list(finished.table()) == ["cal", "rock", "far"]
    assert finished.digests()["index.html"] == before["index.html"]


@pytest.fixture
def own_code(finished: Expedition, tmp_path_factory: pytest.TempPathFactory) -> Expedition:
    """The processed expedition with code of its own, to be edited; records know nothing of where the code lay."""
    return Expedition(finished.root, copy_code(tmp_path_factory.mktemp("edited") / "code", finished.code))


def test_code_moved(own_code: Expedition) -> None:
    assert NOTHING in own_code.run().output


def test_kernel_edited(own_code: Expedition) -> None:
    """An edit that changes no number stops where the bytes stay equal."""
    before = own_code.digests()
    source = own_code.code / "rahas" / "kernels" / "banding.py"
    text = source.read_text(encoding="utf-8")
    at = text.index("\n    return ")
    source.write_text(text[:at] + "\n    _looked_at = True" + text[at:], encoding="utf-8")
    run = run_well(own_code)
    assert_runs("kernel, same bytes", run)
    [told] = run.announced
    assert told.endswith("of rahas/kernels/banding.py was edited: cloud of 1 scan no longer current")
    assert_same_artifacts(before, own_code.digests())
    assert NOTHING in own_code.run().output


def test_kernel_edited_with_other_numbers(own_code: Expedition) -> None:
    """The stage that uses it is computed for every scan, then what reads its numbers; nothing else."""
    edit(own_code.code / "rahas" / "kernels" / "jitter.py", "rms = float(", "rms = 1.001 * float(")
    before = {scan_id: own_code.qa(scan_id)["metrics"]["jitter"] for scan_id in ("cal", "far", "rock")}
    assert_runs("kernel, other numbers", run_well(own_code))
    after = {scan_id: own_code.qa(scan_id)["metrics"]["jitter"] for scan_id in before}
    assert after == pytest.approx({scan_id: 1.001 * jitter for scan_id, jitter in before.items()}, rel=1e-9)


def test_comments_and_format_edited(own_code: Expedition) -> None:
    """Every source file gets a comment; kernels and stages are laid out anew, with other docstrings."""
    for source in sorted((own_code.code / "rahas").rglob("*.py")):
        text = source.read_text(encoding="utf-8")
        if source.parent.name in ("kernels", "stages"):
            tree = ast.parse(text)
            for node in ast.walk(tree):
                if isinstance(node, ast.FunctionDef) and ast.get_docstring(node):
                    node.body[0] = ast.Expr(ast.Constant("Said otherwise."))
            text = ast.unparse(tree)
        source.write_text(text + "\n# a second thought\n", encoding="utf-8")
    assert_runs("comments", own_code.run())


def test_template_edited(own_code: Expedition) -> None:
    for template in (own_code.code / "rahas" / "report" / "templates").iterdir():
        if template.name.endswith(".html.j2"):
            template.write_text(template.read_text(encoding="utf-8") + "\n<!-- -->\n", encoding="utf-8")
    assert_runs("template", run_well(own_code))
