"""Fingerprints of code: what a stage's numbers can depend on, and nothing else.

A fingerprint covers every top-level definition of this package that a stage's entry function reaches, through any
chain of names, and the stage's own entry in the table of stages, over the syntax tree without comments, docstrings and
line breaks. Editing a kernel changes the
fingerprints of the stages that reach it; a comment, a docstring or a new format changes none. Parameter models are
left out: their values stand in the record by themselves. Not seen: dynamic imports, data files, other libraries
(whose versions stand in the record beside the fingerprint).
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from rahas.provenance.definitions import Definition, read_package, read_wiring
from rahas.stores.digests import digest_of_json

PACKAGE = "rahas"
WIRING = "rahas.tasks.pipeline"
LEFT_OUT = frozenset({"rahas", "rahas.params", "rahas.typing"})


class CodeBase:
    """The package's source, read as text: nothing is imported."""

    def __init__(self, root: Path, *, cache: Path | None = None) -> None:
        """``root`` is the folder of the package itself; ``cache`` a file in which what was read of it may be kept."""
        self._modules = read_package(root, PACKAGE, cache=cache)
        self._reaches: dict[tuple[str, str], frozenset[tuple[str, str]]] = {}
        self._fingerprints: dict[str, str] = {}
        self._wiring = read_wiring(root / "tasks" / "pipeline.py")

    def definitions(self, entry: str) -> dict[str, str]:
        """Digest of each definition that ``entry`` (``module:function``) reaches, by its qualified name."""
        reached: dict[tuple[str, str], str] = {}
        module, _, name = entry.partition(":")
        pending = {(module, name)}
        seen = set(pending)
        while pending:
            here = pending.pop()
            definition = self._definition(*here)
            if definition is not None:
                reached[here] = definition.digest
            pending |= self._next(here, definition) - seen
            seen |= pending
        wired = {f"{WIRING}:{entry}": self._wiring[entry]} if entry in self._wiring else {}
        return {f"{module}:{name}": digest for (module, name), digest in sorted(reached.items())} | wired

    def fingerprint(self, entry: str) -> str:
        """One digest over :meth:`definitions`."""
        if entry not in self._fingerprints:
            self._fingerprints[entry] = digest_of_json(self.definitions(entry))
        return self._fingerprints[entry]

    def _definition(self, module: str, name: str) -> Definition | None:
        found = self._modules.get(module)
        if found is None or module in LEFT_OUT or name in found.imported:
            return None
        return found.loose if name == "" else found.definitions.get(name)

    def _next(self, here: tuple[str, str], definition: Definition | None) -> frozenset[tuple[str, str]]:
        """What a name leads to: its origin if it is imported, else what its definition uses."""
        if here not in self._reaches:
            self._reaches[here] = frozenset(self._uses(*here, definition))
        return self._reaches[here]

    def _uses(self, module: str, name: str, definition: Definition | None) -> set[tuple[str, str]]:
        found = self._modules.get(module)
        if found is None or module in LEFT_OUT:
            return set()
        if name in found.imported:
            return {self._origin(*found.imported[name])}
        if definition is None:
            return set()
        used = {(module, ""), *((module, n) for n in definition.names)}
        for base, attribute in definition.attributes:
            origin, item = self._origin(*found.imported[base])
            used.add((origin, item or attribute))
        return used | {self._origin(*one) for one in definition.imports}

    def _origin(self, module: str, name: str | None) -> tuple[str, str]:
        """(module, name) of an import; the name is empty where a module itself is imported."""
        if name is None:
            return module, ""
        if f"{module}.{name}" in self._modules:
            return f"{module}.{name}", ""
        return module, name


@lru_cache(maxsize=1)
def package_code() -> CodeBase:
    """The code base of the package that runs."""
    root = Path(__file__).resolve().parent.parent
    return CodeBase(root, cache=root / "__pycache__" / "definitions.json")
