"""Fingerprints of code: what a stage's numbers can depend on, and nothing else.

A fingerprint covers every top-level definition of this package that a stage's entry function reaches, through any
chain of names, over the syntax tree without comments, docstrings and line breaks. Editing a kernel changes the
fingerprints of the stages that reach it; a comment, a docstring or a new format changes none. Parameter models are
left out: their values stand in the record by themselves. Not seen: dynamic imports, data files, other libraries
(whose versions stand in the record beside the fingerprint).
"""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from rahas.stores.digests import digest_of_bytes, digest_of_json

PACKAGE = "rahas"
LEFT_OUT = frozenset({"rahas", "rahas.params", "rahas.typing"})


@dataclass
class _Module:
    """The top level of one module: what each name is, or where it comes from."""

    definitions: dict[str, list[ast.stmt]] = field(default_factory=dict)
    imported: dict[str, tuple[str, str | None]] = field(default_factory=dict)
    loose: list[ast.stmt] = field(default_factory=list)


class CodeBase:
    """The package's source, read as text: nothing is imported."""

    def __init__(self, root: Path) -> None:
        """``root`` is the folder of the package itself."""
        self._root = root
        self._modules: dict[str, _Module | None] = {}

    def definitions(self, entry: str) -> dict[str, str]:
        """Digest of each definition that ``entry`` (``module:function``) reaches, by its qualified name."""
        reached: dict[str, str] = {}
        module, _, name = entry.partition(":")
        pending = [(module, name)]
        while pending:
            module, name = pending.pop()
            key = f"{module}:{name}"
            if key in reached or module in LEFT_OUT:
                continue
            found = self._module(module)
            if found is None:
                continue
            if name in found.imported:
                pending.append(self._origin(*found.imported[name]))
                continue
            statements = found.loose if name == "" else found.definitions.get(name)
            if statements is None:
                continue
            reached[key] = digest_of_bytes("\n".join(_bare_dump(s) for s in statements).encode())
            pending.append((module, ""))
            for statement in statements:
                pending.extend(self._names_used(module, found, statement))
        return dict(sorted(reached.items()))

    def fingerprint(self, entry: str) -> str:
        """One digest over :meth:`definitions`."""
        return digest_of_json(self.definitions(entry))

    def _names_used(self, module: str, found: _Module, statement: ast.stmt) -> list[tuple[str, str]]:
        used: list[tuple[str, str]] = []
        for node in ast.walk(statement):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                target = found.imported.get(node.value.id)
                if target is not None:
                    origin, name = self._origin(*target)
                    used.append((origin, node.attr) if name == "" else (origin, name))
            elif isinstance(node, ast.Name):
                used.append((module, node.id))
            elif isinstance(node, ast.Import | ast.ImportFrom):  # inside a function
                used.extend(self._origin(*t) for t in _imports(node).values())
        return used

    def _origin(self, module: str, name: str | None) -> tuple[str, str]:
        if name is None:
            return module, ""
        if self._module(f"{module}.{name}") is not None:
            return f"{module}.{name}", ""
        return module, name

    def _module(self, name: str) -> _Module | None:
        if name not in self._modules:
            self._modules[name] = self._read(name)
        return self._modules[name]

    def _read(self, name: str) -> _Module | None:
        parts = name.split(".")
        if parts[0] != PACKAGE:
            return None
        base = self._root.joinpath(*parts[1:])
        file = next((p for p in (base.with_suffix(".py"), base / "__init__.py") if p.is_file()), None)
        if file is None:
            return None
        module = _Module()
        for statement in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(statement, ast.Import | ast.ImportFrom):
                module.imported.update(_imports(statement))
            elif names := _defined_names(statement):
                for defined in names:
                    module.definitions.setdefault(defined, []).append(statement)
            elif not _is_text(statement):
                module.loose.append(statement)
        return module


@lru_cache(maxsize=1)
def package_code() -> CodeBase:
    """The code base of the package that runs."""
    return CodeBase(Path(__file__).resolve().parent.parent)


def _imports(node: ast.Import | ast.ImportFrom) -> dict[str, tuple[str, str | None]]:
    if isinstance(node, ast.Import):
        return {a.asname or a.name.split(".")[0]: (a.name, None) for a in node.names}
    return {a.asname or a.name: (node.module or "", a.name) for a in node.names}


def _defined_names(statement: ast.stmt) -> list[str]:
    if isinstance(statement, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
        return [statement.name]
    if isinstance(statement, ast.Assign | ast.AnnAssign | ast.AugAssign):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        return [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]
    return []


def _is_text(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


class _WithoutText(ast.NodeTransformer):
    """Drops docstrings and other bare strings."""

    def generic_visit(self, node: ast.AST) -> ast.AST:
        super().generic_visit(node)
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [s for s in body if not _is_text(s)] or [ast.Pass()]  # type: ignore[attr-defined]
        return node


def _bare_dump(statement: ast.stmt) -> str:
    copy = ast.parse(ast.unparse(statement))  # our own copy: the tree is walked again by others
    return ast.dump(_WithoutText().visit(copy))
