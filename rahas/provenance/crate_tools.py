"""What could be done (prospective provenance): tools, one a version of a stage's code, their slots, the steps."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from urllib.parse import quote

from rahas.provenance.actions import Action, Artifact
from rahas.provenance.crate_data import Entity, reference, references
from rahas.stores.digests import canonical_json, digest_of_json

_TYPES = {bool: "Boolean", int: "Integer", float: "Float", str: "Text", list: "Text", tuple: "Text"}


class Tools:
    """The tools that a set of actions used, and the parameters that these gave them."""

    def __init__(self) -> None:
        self.entities: dict[str, Entity] = {}
        self.tools: list[str] = []
        self._of_stage: dict[str, list[str]] = {}
        self._values: dict[tuple[str, str, str], str] = {}

    def add(self, action: Action) -> str:
        """Enter the tool that an action used; return its identifier."""
        versions = digest_of_json([action.code, dict(action.libraries), action.rahas])
        identifier = f"#tool/{action.stage}/{versions[:12]}"
        if identifier not in self.entities:
            self.entities[identifier] = {
                "@id": identifier,
                "@type": "SoftwareApplication",
                "name": f"rahas {action.stage}",
                "description": f"{action.entry}; the identifier is the fingerprint of all code that it reaches.",
                "identifier": f"sha256:{action.code}",
                "softwareVersion": f"{action.rahas}+{action.code[:12]}",
                "softwareRequirements": [self._library(*one) for one in sorted(action.libraries.items())],
            }
            self.tools.append(identifier)
            self._of_stage.setdefault(action.stage, []).append(identifier)
        return identifier

    def slot(self, tool: str, stage: str, side: str, artifact: Artifact) -> str:
        """The formal parameter (``side``: input or output) through which a tool reads or writes an artifact."""
        scan, _, rest = artifact.path.removeprefix("results/").partition("/")
        own = artifact.path.startswith("results/") and bool(rest)
        name = rest if own and scan != "expedition" else artifact.name if own or side == "output" else _kind(artifact)
        return self._parameter(tool, stage, side, name, "Dataset" if artifact.folder else "File")

    def value(self, tool: str, stage: str, name: str, value: Any) -> str:
        """A value of one of the tool's parameters, the same entity for all actions that used it."""
        slot = self._parameter(tool, stage, "input", name, _TYPES.get(type(value), "Text"))
        seen = (stage, name, repr(value))
        if seen in self._values:
            return self._values[seen]
        identifier = f"#value/{stage}/{quote(name)}/{digest_of_json(value)[:12]}"
        plain = isinstance(value, bool | int | float | str)
        self.entities[identifier] = {
            "@id": identifier,
            "@type": "PropertyValue",
            "name": name,
            "value": value if plain else canonical_json(value),
            "exampleOfWork": reference(slot),
        }
        self._values[seen] = identifier
        return identifier

    def steps(self, order: Iterable[str]) -> list[Entity]:
        """The workflow's steps, in ``order``; of the stages of which an action is known."""
        return [
            {
                "@id": step_of(stage),
                "@type": "HowToStep",
                "name": stage,
                "position": str(position),
                "workExample": references(self._of_stage[stage]),
            }
            for position, stage in enumerate(order, 1)
            if stage in self._of_stage
        ]

    def _parameter(self, tool: str, stage: str, side: str, name: str, kind: str) -> str:
        identifier = f"#{side}/{stage}/{quote(name)}"
        entity = self.entities.setdefault(
            identifier, {"@id": identifier, "@type": "FormalParameter", "name": name, "additionalType": kind}
        )
        if entity["additionalType"] == "Text" != kind:  # a parameter that may be left out: null, then a number
            entity["additionalType"] = kind
        slots = self.entities[tool].setdefault(side, [])
        if reference(identifier) not in slots:
            slots.append(reference(identifier))
        return identifier

    def _library(self, name: str, version: str) -> Entity:
        identifier = f"#library/{name}/{version}"
        self.entities[identifier] = {
            "@id": identifier, "@type": "SoftwareApplication", "name": name, "softwareVersion": version,
        }  # fmt: skip
        return reference(identifier)


def step_of(stage: str) -> str:
    """Identifier of a stage as a step of the workflow."""
    return f"#step/{stage}"


def _kind(artifact: Artifact) -> str:
    """What a raw file is to the tool that reads it."""
    if artifact.path.startswith("captures/"):
        return "texture" if "_texture." in artifact.name else "capture"
    return artifact.path
