"""One Slurm for all tests, stopped in the end; a small expedition that it has processed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cluster.runs import ClusterExpedition
from tests.cluster.slurm import Slurm
from tests.workflow.expedition import Expedition, Run


@pytest.fixture(scope="session")
def slurm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Slurm]:
    with Slurm(tmp_path_factory.mktemp("slurm")) as cluster:
        yield cluster


@pytest.fixture(scope="session")
def on_cluster(
    rendered: Expedition, slurm: Slurm, tmp_path_factory: pytest.TempPathFactory
) -> tuple[ClusterExpedition, Run]:
    """The rendered expedition after its first run on the cluster, and what that said. Not to be changed: copy it."""
    root = tmp_path_factory.mktemp("on_cluster") / "expedition"
    expedition = ClusterExpedition(rendered.copy(root).root, rendered.code, slurm)
    return expedition, expedition.run()


@pytest.fixture
def processed(on_cluster: tuple[ClusterExpedition, Run], tmp_path: Path) -> ClusterExpedition:
    """A processed copy to work on."""
    expedition, run = on_cluster
    assert run.status == 0, run.output
    return expedition.copy(tmp_path / "expedition")
