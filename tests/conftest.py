"""Shared fixtures: a small rendered expedition, as brought home and as processed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.workflow.expedition import Expedition, Run


@pytest.fixture(scope="session")
def code(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project's code, copied: the whole session runs the same."""
    from tests.workflow.expedition import copy_code

    return copy_code(tmp_path_factory.mktemp("code") / "rahas of this session")


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory, code: Path) -> Expedition:
    """Captures, target and log; nothing processed. Not to be changed: copy it."""
    from tests.workflow.expedition import Expedition, render_expedition

    root = tmp_path_factory.mktemp("rendered") / "expedition"
    render_expedition(root)
    return Expedition(root, code)


@pytest.fixture(scope="session")
def first_run(rendered: Expedition, tmp_path_factory: pytest.TempPathFactory) -> tuple[Expedition, Run]:
    """The expedition after its first run, and what that said. Not to be changed: copy it."""
    expedition = rendered.copy(tmp_path_factory.mktemp("finished") / "expedition")
    return expedition, expedition.run()


@pytest.fixture
def expedition(rendered: Expedition, tmp_path: Path) -> Expedition:
    """A copy to work on, nothing processed."""
    return rendered.copy(tmp_path / "expedition")


@pytest.fixture
def finished(first_run: tuple[Expedition, Run], tmp_path: Path) -> Expedition:
    """A processed copy to work on."""
    expedition, run = first_run
    assert run.status == 0, run.output
    return expedition.copy(tmp_path / "expedition")
