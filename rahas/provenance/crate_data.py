"""Data entities of the crate: files, stores and folders, each once, under an address from the crate's folder."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

from rahas.provenance.actions import Artifact
from rahas.stores.digests import MANIFEST_NAME

Entity = dict[str, Any]
# Written out, because what a system's own table of types says differs from machine to machine.
_FORMATS = {
    "csv": "text/csv", "html": "text/html", "json": "application/json", "yaml": "application/yaml",
    "ply": "application/octet-stream", "png": "image/png", "jpg": "image/jpeg", "tif": "image/tiff",
    "mkv": "video/x-matroska", "mp4": "video/mp4", "mpg": "video/mpeg", "avi": "video/x-msvideo",
}  # fmt: skip


def reference(identifier: str) -> Entity:
    """A link to another entity."""
    return {"@id": identifier}


def references(identifiers: list[str]) -> list[Entity]:
    """Links to other entities, each once, in their order."""
    return [reference(identifier) for identifier in dict.fromkeys(identifiers)]


class DataEntities:
    """The files of a crate as they are asked for; the first digest that is told of a path is the path's own."""

    def __init__(self, prefix: str) -> None:
        """``prefix`` leads from the crate's folder to the expedition's: empty, or ending with a slash."""
        self._prefix = prefix
        self._digests: dict[str, str] = {}
        self.entities: dict[str, Entity] = {}
        self.parts: list[str] = []
        """Addresses of what the crate itself holds."""

    def address(self, path: str, *, folder: bool = False) -> str:
        """Address of a path from the expedition's folder, or with ``./`` before it from the crate's."""
        whole = path[2:] if path.startswith("./") else self._prefix + path
        return quote(whole) + ("/" if folder else "")

    def add(self, artifact: Artifact, parameters: list[str] | None = None) -> str:
        """Enter an artifact, if it is not there yet; return its address.

        ``parameters`` are the formal parameters that it stands for. Bytes that have since been replaced under the
        same path become an entity of their own, which no longer is a part of the crate.
        """
        known = self._digests.setdefault(artifact.path, artifact.sha256)
        if known != artifact.sha256:
            return self._former(artifact)
        address = self.address(artifact.path, folder=artifact.folder)
        if address not in self.entities:
            self.parts.append(address)
            self.entities[address] = self._folder(artifact) if artifact.folder else _file(address, artifact)
        if parameters:
            stands_for = [one["@id"] for one in self.entities[address].get("exampleOfWork", [])]
            self.entities[address]["exampleOfWork"] = references([*stands_for, *parameters])
        return address

    def _folder(self, artifact: Artifact) -> Entity:
        address = self.address(artifact.path, folder=True)
        entity: Entity = {"@id": address, "@type": "Dataset", "name": artifact.path}
        if artifact.size is not None:
            entity["contentSize"] = str(artifact.size)
        if not artifact.is_store:
            return entity | {
                "description": "The identifier is the SHA-256 of the list of its files' SHA-256.",
                "identifier": f"sha256:{artifact.sha256}",
            }
        manifest = Artifact(f"{artifact.path}/{MANIFEST_NAME}", artifact.sha256)
        where = self.address(manifest.path)
        self.entities[where] = _file(where, manifest)
        return entity | {
            "description": f"A zarr store; its {MANIFEST_NAME} names every file of it with its SHA-256.",
            "hasPart": [reference(where)],
        }

    def _former(self, artifact: Artifact) -> str:
        address = f"#former/{quote(artifact.path)}/{artifact.sha256[:12]}"
        self.entities[address] = {
            "@id": address,
            "@type": "CreativeWork",
            "name": f"{artifact.path} as it was",
            "description": "Other bytes lie under this path now.",
            "alternateName": artifact.path,
            "identifier": f"sha256:{artifact.sha256}",
        }
        return address


def _file(address: str, artifact: Artifact) -> Entity:
    entity: Entity = {"@id": address, "@type": "File", "name": artifact.path, "sha256": artifact.sha256}
    if artifact.size is not None:
        entity["contentSize"] = str(artifact.size)
    encoding = _FORMATS.get(artifact.name.rpartition(".")[2].lower())
    return entity | ({"encodingFormat": encoding} if encoding else {})
