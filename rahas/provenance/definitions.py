"""What the top-level definitions of a package are and which names they use, from its source read as text.

Parsing costs half a second, and every job asks. So what was read of a module is kept beside the byte code, under the
digest of its source (and of this file's): a module that was edited is read anew, whatever its modification time.
"""

from __future__ import annotations

import ast
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from rahas.stores.digests import digest_of_bytes, digest_of_json

_NOT_CODE = frozenset({"kind", "type_comment", "ctx"})


class Definition(NamedTuple):
    """A top-level definition, or the loose statements of a module."""

    digest: str
    """Of its syntax tree without comments, docstrings and line breaks."""
    names: list[str]
    """Top-level names of the same module that it uses."""
    attributes: list[tuple[str, str]]
    """(imported name, attribute) that it uses."""
    imports: list[tuple[str, str | None]]
    """(module, name) that it imports itself."""


class Module(NamedTuple):
    """The top level of one module: what each name is, or where it comes from."""

    definitions: dict[str, Definition]
    imported: dict[str, tuple[str, str | None]]
    loose: Definition


def read_package(root: Path, package: str, *, cache: Path | None = None) -> dict[str, Module]:
    """Every module below the folder ``root`` of ``package`` by its dotted name; ``cache`` is a file."""
    sources = {_dotted(package, file.relative_to(root)): file.read_bytes() for file in sorted(root.rglob("*.py"))}
    keys = {name: digest_of_bytes(source) for name, source in sources.items()}
    reader = digest_of_json([digest_of_bytes(Path(__file__).read_bytes()), sys.version])
    known = _kept(cache, reader)
    read = {key: known[key] if key in known else _read(sources[name]) for name, key in keys.items()}
    if cache is not None and read.keys() - known.keys():
        _keep(cache, {"reader": reader, "modules": read})
    return {name: read[key] for name, key in keys.items()}


def read_wiring(table: Path) -> dict[str, str]:
    """Digest of each stage's ``Stage(…)`` in the table of stages by its ``entry``; empty where there is no table."""
    if not table.is_file():
        return {}
    calls = (node for node in ast.walk(ast.parse(table.read_bytes())) if isinstance(node, ast.Call))
    found: dict[str, str] = {}
    for call in calls:
        words = {keyword.arg: keyword.value for keyword in call.keywords}
        entry = words.get("entry")
        if isinstance(call.func, ast.Name) and call.func.id == "Stage" and isinstance(entry, ast.Constant):
            found[str(entry.value)] = _definition([ast.Expr(call)], set(), {}).digest
    return found


def _dotted(package: str, file: Path) -> str:
    parts = file.with_suffix("").parts
    return ".".join((package, *(parts[:-1] if parts[-1] == "__init__" else parts)))


def _read(source: bytes) -> Module:
    tree = ast.parse(source)
    imported: dict[str, tuple[str, str | None]] = {}
    defined: dict[str, list[ast.stmt]] = {}
    loose: list[ast.stmt] = []
    for statement in tree.body:
        if isinstance(statement, ast.Import | ast.ImportFrom):
            imported.update(_imports(statement))
        elif names := _defined_names(statement):
            for name in names:
                defined.setdefault(name, []).append(statement)
        elif not _is_text(statement):
            loose.append(statement)
    here = defined.keys() | imported.keys()
    definitions = {name: _definition(statements, here, imported) for name, statements in defined.items()}
    return Module(definitions, imported, _definition(loose, here, imported))


def _definition(statements: list[ast.stmt], here: set[str], imported: dict[str, tuple[str, str | None]]) -> Definition:
    text: list[str] = []
    names: dict[str, None] = {}
    attributes: dict[tuple[str, str], None] = {}
    imports: dict[tuple[str, str | None], None] = {}

    def visit(node: Any) -> None:
        if isinstance(node, ast.AST):
            if isinstance(node, ast.Name):
                if node.id in here:
                    names[node.id] = None
            elif isinstance(node, ast.Attribute):
                if isinstance(node.value, ast.Name) and node.value.id in imported:
                    attributes[node.value.id, node.attr] = None
            elif isinstance(node, ast.Import | ast.ImportFrom):
                imports.update(dict.fromkeys(_imports(node).values()))
            text.append(f"{type(node).__name__}(")
            for field in node._fields:
                if field in _NOT_CODE:
                    continue
                value = getattr(node, field, None)
                if field == "body" and isinstance(value, list):
                    value = [s for s in value if not _is_text(s)] or [ast.Pass()]
                text.append(f"{field}=")
                visit(value)
            text.append(")")
        elif isinstance(node, list):
            text.append("[")
            for one in node:
                visit(one)
                text.append(",")
            text.append("]")
        else:
            text.append(repr(node))

    visit(statements)
    return Definition(digest_of_bytes("".join(text).encode()), list(names), list(attributes), list(imports))


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


def _is_text(statement: Any) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def _kept(cache: Path | None, reader: str) -> dict[str, Module]:
    """What an earlier process kept; nothing where it cannot be read or another reader wrote it."""
    try:
        kept = json.loads(cache.read_bytes()) if cache is not None else {}
        if kept.get("reader") != reader:
            return {}
        return {
            key: Module(
                {name: _revived(d) for name, d in definitions.items()},
                {name: (origin, item) for name, (origin, item) in imported.items()},
                _revived(loose),
            )
            for key, (definitions, imported, loose) in kept["modules"].items()
        }
    except (OSError, ValueError):
        return {}


def _revived(raw: list[Any]) -> Definition:
    digest, names, attributes, imports = raw
    return Definition(digest, names, [tuple(a) for a in attributes], [tuple(i) for i in imports])


def _keep(cache: Path, content: dict[str, Any]) -> None:
    """Leave it for the next process; a folder that cannot be written is no harm."""
    if sys.dont_write_bytecode:
        return
    try:
        cache.parent.mkdir(exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=cache.parent, delete=False, encoding="utf-8") as handle:
            json.dump(content, handle)
        os.replace(handle.name, cache)
    except OSError:
        return
