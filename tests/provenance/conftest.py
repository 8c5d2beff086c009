"""A processed expedition over synthetic artifacts, made once; copies of it to work on."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.provenance.tree import Tree, bring_home, process


@pytest.fixture(scope="session")
def processed_tree(tmp_path_factory: pytest.TempPathFactory) -> Tree:
    """Not to be changed, or put right again at once: copy it."""
    root = tmp_path_factory.mktemp("audited") / "expedition"
    bring_home(root)
    with pytest.MonkeyPatch.context() as patch:
        process(root, patch)
    return Tree(root)


@pytest.fixture
def tree(processed_tree: Tree, tmp_path: Path) -> Tree:
    """A copy to work on."""
    return processed_tree.copy(tmp_path / "expedition")
