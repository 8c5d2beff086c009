"""What an audit says of a clean expedition, of one that is no longer current, and of what does not belong to it."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from rahas.provenance.audit import Finding
from rahas.provenance.fingerprints import CodeBase
from rahas.stores.layout import ScanFolder
from rahas.tasks import audit as audit_task
from rahas.tasks import make, plan, recipes
from tests.provenance.tree import ROWS, Tree, process
from tests.workflow.expedition import PROJECT, edit, row

WITH_CLOUD = {"rock", "rock2", "made", "late"}  # the last one's was looked at, and taken away


def only(findings: list[Finding]) -> Finding:
    assert len(findings) == 1, [f"{f.kind} {f.artifact} {f.text}" for f in findings]
    return findings[0]


# clean


def test_clean_after_copy_without_times_and_without_schedulers_folder(tree: Tree) -> None:
    shutil.rmtree(tree.root / ".snakemake")
    assert tree.audit().findings == []


def test_clean_after_touch(tree: Tree) -> None:
    for n, path in enumerate(sorted(tree.root.rglob("*"))):
        os.utime(path, (1_000_000_000 + n, 1_000_000_000 + n))
    assert tree.audit().findings == []


def test_clean_without_companions_tables_of_code_and_stamps(tree: Tree) -> None:
    """None of them is an artifact: they are missed by nobody."""
    for path in tree.results.rglob("provenance/*"):
        if path.name.endswith(".made.json") or not path.name.endswith(".json"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert tree.audit().findings == []


def test_clean_with_what_the_scheduler_leaves_in_a_store(tree: Tree) -> None:
    (tree.results / "rock" / "phase.zarr" / ".snakemake_timestamp").touch()
    assert tree.audit().findings == []


def test_clean_where_a_rejected_scan_was_let_through(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    """The wish stands in the records, not in any file of the expedition."""
    process(tree.root, monkeypatch, {"include_rejected": "far"})
    assert (tree.results / "far" / "cloud.ply").exists()
    assert tree.audit().findings == []


def test_clean_where_the_operator_rejected_the_calibration(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its scans are rejected with it; then all come back."""
    tree.log(*(r | {"decision": "reject"} if r["scan_id"] == "cal" else r for r in ROWS))
    process(tree.root, monkeypatch)
    assert not (tree.results / "rock" / "cloud.ply").exists()
    assert tree.audit().findings == []
    tree.log(*ROWS)
    process(tree.root, monkeypatch)
    assert (tree.results / "rock" / "cloud.ply").exists()
    assert tree.audit().findings == []


# current


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """The project's code at another place, to be edited."""
    return Path(
        shutil.copytree(
            PROJECT / "rahas", tmp_path / "rahas", ignore=shutil.ignore_patterns("__pycache__", "templates")
        )
    )


def edit_kernel(package: Path) -> str:
    """Edit the first function of a kernel that only the cloud uses; its name."""
    source = package / "kernels" / "banding.py"
    edit(source, "\n    return ", "\n    _seen = 1\n    return ")
    return source.read_text(encoding="utf-8").partition("_seen = 1")[0].rpartition("\ndef ")[2].partition("(")[0]


def use_code(code: CodeBase, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (audit_task, make, recipes):
        monkeypatch.setattr(module, "package_code", lambda: code)


def test_edited_kernel_is_named(tree: Tree, package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (package / "kernels" / "noise.py").write_text(
        "# a comment\n" + (package / "kernels" / "noise.py").read_text(encoding="utf-8"), encoding="utf-8"
    )
    use_code(CodeBase(package), monkeypatch)
    assert tree.audit().findings == []
    function = edit_kernel(package)
    use_code(CodeBase(package), monkeypatch)
    found = tree.audit().findings
    assert {(f.kind, f.scan, f.stage) for f in found} == {("stale", s, "cloud") for s in WITH_CLOUD}
    assert {f.text for f in found} == {f"code: function {function} of rahas/kernels/banding.py was edited"}
    change = found[0].changes[0]
    assert (change.kind, change.name) == ("code", f"rahas.kernels.banding:{function}")


def test_edited_kernel_without_its_table_is_told_all_the_same(
    tree: Tree, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.rmtree(tree.results / "expedition" / "provenance" / "code")
    edit_kernel(package)
    use_code(CodeBase(package), monkeypatch)
    found = tree.audit("results/rock/cloud.ply").findings
    assert only(found).text.startswith("the code changed (")
    assert "not known" in only(found).text


def test_changed_parameter_is_named_with_its_values(tree: Tree) -> None:
    tree.configure("cloud:\n  normal_radius_px: 5\n")
    found = tree.audit().findings
    assert {(f.kind, f.scan, f.stage) for f in found} == {("stale", s, "cloud") for s in WITH_CLOUD}
    assert {f.text for f in found} == {"parameter normal_radius_px: 2 → 5"}
    change = found[0].changes[0]
    assert (change.kind, change.name, change.was, change.now) == ("parameter", "normal_radius_px", 2, 5)


def test_another_library_is_named(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    real = make.library_versions
    newer = {"scipy": "99.0"}
    monkeypatch.setattr(
        make, "library_versions", lambda *names: {**real(*names), **{n: newer[n] for n in names if n in newer}}
    )
    found = tree.audit("results/rock/timeline.json").findings
    told = only([f for f in found if f.stage == "timeline"])
    assert told.text == f"library scipy: {real('scipy')['scipy']} → 99.0"


def test_edited_note_makes_only_pages_outdated(tree: Tree) -> None:
    tree.log(*(r | {"notes": "wet"} if r["scan_id"] == "rock" else r for r in ROWS))
    found = only(tree.audit().findings)
    assert (found.kind, found.scan, found.stage) == ("stale", "rock", "page")
    assert found.text == "column notes of the log: 'circle, \"under\" the ledge' → 'wet'"


def test_replaced_raw_file_is_named(tree: Tree) -> None:
    (tree.root / "captures" / "rock.mkv").write_bytes(b"shot again")
    found = only(tree.audit().findings)
    assert (found.kind, found.scan, found.stage, found.artifact) == ("raw", "rock", "ingest", "captures/rock.mkv")


def test_replaced_target_concerns_the_calibration(tree: Tree) -> None:
    with open(tree.root / "config" / "target.csv", "a", encoding="utf-8") as file:
        file.write("\n")
    found = only(tree.audit().findings)
    assert (found.kind, found.scan, found.stage, found.artifact) == ("raw", "cal", "calibrate", "config/target.csv")


def test_other_calibration_breaks_the_chain(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    """A calibration that was made anew, its scans not yet."""
    rows = [r | ({"capture": "rock2.mkv"} if r["scan_id"] == "cal" else {}) for r in ROWS]
    tree.log(*rows)
    process(tree.root, monkeypatch, only=("cal",))
    found = tree.audit("rock").findings
    assert {(f.kind, f.scan) for f in found if f.kind != "stale"} <= {("chain", "rock")}
    assert "input" in next(f.text for f in found if f.kind == "chain")


def test_render_that_was_described_otherwise(tree: Tree) -> None:
    edit(tree.root / "config" / "simulation.yaml", "{kind: circle}", "{kind: monkey}")
    found = only(tree.audit().findings)
    assert (found.kind, found.scan, found.stage) == ("stale", "made", "render")
    assert found.text == "parameter scene.kind: 'circle' → 'monkey'"


def test_mixed_versions_are_told(tree: Tree, package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One scan made again by edited code, the others not."""
    function = edit_kernel(package)
    code = CodeBase(package)
    use_code(code, monkeypatch)
    monkeypatch.setattr(plan, "package_code", lambda: code)
    process(tree.root, monkeypatch, only=("rock",))
    found = tree.audit().findings
    mixed = only([f for f in found if f.kind == "mixed"])
    assert mixed.stage == "cloud"
    assert "2 versions" in mixed.text
    assert mixed.text.endswith(f"they differ in rahas.kernels.banding:{function}")
    assert {(f.scan, f.stage) for f in found if f.kind == "stale"} == {(s, "cloud") for s in WITH_CLOUD - {"rock"}}


# what does not belong there


def test_strays_are_told(tree: Tree) -> None:
    (tree.results / "notes.txt").write_text("mine")
    (tree.results / "rock" / "cloud-copy.ply").write_bytes(b"ply")
    (tree.results / "rock" / ".making-abc").mkdir()
    (tree.results / "rock" / ".making-abc" / "phase.zarr").write_bytes(b"half")
    (tree.results / "history" / "old.txt").write_text("?")
    (tree.root / "captures" / "simulated" / ".making-1").mkdir()
    found = {(f.kind, f.artifact) for f in tree.audit().findings}
    assert found == {
        ("orphan", "results/notes.txt"),
        ("orphan", "results/rock/cloud-copy.ply"),
        ("orphan", "results/history/old.txt"),
        ("leftover", "results/rock/.making-abc"),
        ("leftover", "captures/simulated/.making-1"),
    }


def test_row_that_left_the_log(tree: Tree) -> None:
    tree.log(*(r for r in ROWS if r["scan_id"] != "rock2"))
    found = tree.audit().findings
    assert ("row", "results/rock2") in {(f.kind, f.artifact) for f in found}
    assert {f.stage for f in found if f.kind == "stale"} == {"summary"}


def test_row_that_was_rejected_since(tree: Tree) -> None:
    tree.log(*(r | {"decision": "reject"} if r["scan_id"] == "rock2" else r for r in ROWS))
    found = tree.audit().findings
    lingering = {f.artifact for f in found if f.kind == "lingering"}
    assert {"results/rock2/cloud.ply", "results/rock2/frames.zarr"} <= lingering
    assert {f.scan for f in found if f.kind == "lingering"} == {"rock2"}


def test_new_row_is_unfinished(tree: Tree) -> None:
    tree.log(*ROWS, row("next", capture="rock.mkv"))
    found = [f for f in tree.audit().findings if f.scan == "next"]
    assert only(found).kind == "unfinished"


def test_killed_job_is_unfinished(tree: Tree) -> None:
    path = ScanFolder(tree.results, "rock").records / "snakes.json"
    from rahas.provenance.records import MAKING, Record, read_record

    record = read_record(path)
    assert record is not None
    Record(record.recipe, MAKING).write(path)
    found = tree.audit("rock").findings
    assert ("unfinished", "snakes") in {(f.kind, f.stage) for f in found}
