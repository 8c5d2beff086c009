"""Imports go one way through the house; kernels and stages see no files."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "rahas"

# a layer may import those named here, and itself
ALLOWED = {
    "errors": set(),
    "typing": set(),
    "vocabulary": {"typing"},
    "params": {"errors", "typing", "vocabulary"},
    "kernels": {"errors", "typing", "vocabulary"},
    "simulate": {"kernels", "params", "errors", "typing", "vocabulary"},
    "stages": {"kernels", "params", "errors", "typing", "vocabulary"},
    "stores": {"params", "errors", "typing", "vocabulary"},
    "qa": {"params", "errors", "typing", "vocabulary"},
    "provenance": {"stores", "errors", "typing"},
    "report": {"stores", "kernels", "params", "errors", "typing", "vocabulary"},
    "tasks": {
        "stages", "stores", "qa", "provenance", "report", "simulate", "kernels", "params", "errors", "typing",
        "vocabulary",
    },
    "cli": {"tasks", "stores", "errors"},
}  # fmt: skip
FORBIDDEN_IN_KERNELS = {"pathlib", "os", "logging", "zarr", "yaml", "pydantic", "av", "json"}


def _modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def _imported(path: Path) -> list[str]:
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found.append(node.module or "")
            if node.module == "rahas":
                found += [f"rahas.{a.name}" for a in node.names]
    return found


def _layer(name: str) -> str:
    parts = name.split(".")
    return parts[1] if len(parts) > 1 else ""


@pytest.mark.parametrize("path", _modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_one_way(path: Path) -> None:
    own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if own == "__init__":
        return
    for name in _imported(path):
        if name.startswith("rahas."):
            layer = _layer(name)
            allowed = ALLOWED[own] | {own, "__version__"}
            assert layer in allowed, f"{path.name} ({own}) imports {name}: expected one of {sorted(allowed)}"


@pytest.mark.parametrize("path", sorted((PACKAGE / "kernels").glob("*.py")), ids=lambda p: p.name)
def test_kernels_see_no_files(path: Path) -> None:
    roots = {name.split(".")[0] for name in _imported(path)}
    assert not roots & FORBIDDEN_IN_KERNELS


def test_stages_see_no_paths() -> None:
    for path in sorted((PACKAGE / "stages").glob("*.py")):
        assert "pathlib" not in {name.split(".")[0] for name in _imported(path)}, path.name


def test_every_layer_is_known() -> None:
    names = {p.name.removesuffix(".py") for p in PACKAGE.iterdir() if not p.name.startswith("__")}
    assert names == set(ALLOWED)
