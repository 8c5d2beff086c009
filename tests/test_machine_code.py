"""Compiled functions hold nothing of other modules.

numba keeps machine code until the file of the function itself changes. What it took from another module, a constant or
a compiled function, would stay as it was when that module is edited: the source would say one thing, the results
another.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "rahas"
COMPILED = [path for path in sorted(PACKAGE.rglob("*.py")) if "njit" in path.read_text(encoding="utf-8")]


def borrowed(source: str) -> set[str]:
    """Names from other modules of the package that compiled functions use, by themselves or through a module's own."""
    tree = ast.parse(source)
    imported = {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rahas")
        for alias in node.names
    }
    own = {
        target.id: node
        for node in tree.body
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
        if isinstance(target, ast.Name)
    }
    found: set[str] = set()
    for node in tree.body:
        if not (isinstance(node, ast.FunctionDef) and any("njit" in ast.dump(d) for d in node.decorator_list)):
            continue
        pending = _names(*node.body)
        while pending:
            name = pending.pop()
            if name in imported:
                found.add(f"{node.name}: {name}")
            elif name in own:
                value = own.pop(name).value
                pending |= _names(value) if value is not None else set()
    return found


def _names(*nodes: ast.AST) -> set[str]:
    return {n.id for node in nodes for n in ast.walk(node) if isinstance(n, ast.Name)}


@pytest.mark.parametrize("path", COMPILED, ids=lambda p: p.stem)
def test_nothing_is_borrowed(path: Path) -> None:
    assert borrowed(path.read_text(encoding="utf-8")) == set()


def test_what_is_borrowed_is_found() -> None:
    source = """
from rahas.kernels.other import LIMIT, TURN
HALF = 0.5 * TURN
@numba.njit(cache=True)
def one(x): return min(x, LIMIT)
@numba.njit
def two(x): return x * HALF
def plain(x): return x * TURN
"""
    assert borrowed(source) == {"one: LIMIT", "two: TURN"}
    assert len(COMPILED) > 5
