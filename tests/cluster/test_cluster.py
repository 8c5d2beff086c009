"""Through sbatch: the same bytes as on one machine, few submissions, and after an edit only what it touches."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cluster.runs import ClusterExpedition, embedded_expedition, jobs_by_message, recorded_outputs
from tests.cluster.slurm import Slurm
from tests.workflow.expedition import (
    NOTHING,
    PROJECT,
    ROWS,
    Expedition,
    Run,
    assert_whole,
    copy_code,
    edit,
)

pytestmark = [pytest.mark.cluster, pytest.mark.timeout(7200)]


def assert_same_results(one: Path, other: Path) -> None:
    """Outputs in all records, and all files but stamps and the companions that hold times and host, byte for byte."""
    mine, theirs = recorded_outputs(one / "results"), recorded_outputs(other / "results")
    assert mine == theirs
    assert sum(outcome == "made" for outcome, _, _ in mine.values()) > 10
    files = [Expedition(root, root).digests().items() for root in (one, other)]
    numbers = [{n: d for n, d in found if "/provenance/" not in n and not n.endswith(".made.json")} for found in files]
    assert numbers[0] == numbers[1]


def test_small_expedition_as_on_one_machine(
    first_run: tuple[Expedition, Run], on_cluster: tuple[ClusterExpedition, Run]
) -> None:
    local, cluster = first_run[0], on_cluster[0]
    assert first_run[1].status == 0, first_run[1].output
    assert on_cluster[1].status == 0, on_cluster[1].output
    assert on_cluster[1].made == first_run[1].made
    assert_whole(cluster.root / "results")
    assert_same_results(local.root, cluster.root)


def test_a_row_is_one_submission(processed: ClusterExpedition) -> None:
    """Calibration and scans, three jobs each: as many submissions as rows; then nothing to do, and none."""
    expedition = ClusterExpedition(processed.root, processed.code, processed.cluster)
    before = expedition.cluster.submitted()
    assert NOTHING in expedition.run().output
    assert expedition.cluster.submitted() == before
    for store in expedition.root.glob("results/*/frames.zarr"):
        (store / "manifest.json").unlink()
    run = expedition.run()
    assert run.status == 0, run.output
    assert expedition.cluster.submitted() - before == len(ROWS)


def test_scans_share_a_submission(processed: ClusterExpedition) -> None:
    for store in processed.root.glob("results/*/frames.zarr"):
        (store / "manifest.json").unlink()
    before = processed.cluster.submitted()
    run = processed.run("--group-components", "scan=2", "calibration=1")
    assert run.status == 0, run.output
    assert processed.cluster.submitted() - before == 2


def test_only_affected_jobs_after_an_edit(processed: ClusterExpedition, tmp_path: Path) -> None:
    """A kernel of the cloud: the surface jobs of the scans, no capture, no phase, no calibration."""
    code = copy_code(tmp_path / "code", processed.code)
    expedition = ClusterExpedition(processed.root, code, processed.cluster)
    assert NOTHING in expedition.run().output
    source = code / "rahas" / "kernels" / "banding.py"
    text = source.read_text(encoding="utf-8")
    at = text.index("\n    return ")
    source.write_text(text[:at] + "\n    _looked_at = True" + text[at:], encoding="utf-8")

    local = Expedition(expedition.copy(tmp_path / "local").root, code)
    here = local.run()
    assert here.status == 0, here.output
    before = expedition.cluster.submitted()
    with expedition.start() as process:
        said, _ = process.communicate(timeout=600)
    assert process.returncode == 0, said
    submitted = expedition.cluster.submitted() - before
    assert jobs_by_message(said) == jobs_by_message(here.output)
    assert jobs_by_message(said) == {"triangulating, debanding, reviewing": 2}
    assert submitted == 2
    assert ("rock", "cloud") in expedition.made_so_far()
    assert {stage for _, stage in expedition.made_so_far()} <= {"cloud"}
    assert_same_results(local.root, expedition.root)


def test_comment_submits_nothing(processed: ClusterExpedition, tmp_path: Path) -> None:
    code = copy_code(tmp_path / "code", processed.code)
    edit(code / "rahas" / "kernels" / "banding.py", '"""', '"""Said otherwise. ')
    before = processed.cluster.submitted()
    assert NOTHING in ClusterExpedition(processed.root, code, processed.cluster).run().output
    assert processed.cluster.submitted() == before


def test_embedded_expedition(slurm: Slurm, tmp_path: Path) -> None:
    """All rows of the project's own log, rendered and processed: here, and through sbatch."""
    local = embedded_expedition(tmp_path / "local", PROJECT)
    here = Expedition(local, local).run(timeout=3600)
    assert here.status == 0, here.output
    root = embedded_expedition(tmp_path / "cluster", PROJECT)
    before = slurm.submitted()
    there = ClusterExpedition(root, root, slurm).run(timeout=3600)
    assert there.status == 0, there.output
    rows = len((root / "field_log.csv").read_text(encoding="utf-8").splitlines()) - 1
    assert slurm.submitted() - before == rows
    assert_whole(root / "results")
    assert_same_results(local, root)
