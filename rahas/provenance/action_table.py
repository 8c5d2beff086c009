"""The export as a table: one row an action, the same facts as in the crate."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable

from rahas.provenance.actions import Action, Artifact
from rahas.stores.digests import canonical_json

COLUMNS = (
    *("scan_id", "stage", "outcome", "inputs", "input_sha256", "outputs", "output_sha256", "parameters"),
    *("code", "libraries", "rahas", "commit", "host", "started", "ended", "message"),
)


def action_table(actions: Iterable[Action]) -> str:
    """CSV with a header. Several values in a cell are separated by a line break, digests in the order of the paths."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    for action in actions:
        writer.writerow(
            [
                *(action.scan_id, action.stage, action.outcome),
                *(_paths(action.inputs), _digests(action.inputs), _paths(action.outputs), _digests(action.outputs)),
                canonical_json(dict(action.parameters)),
                *(action.code, canonical_json(dict(action.libraries)), action.rahas),
                *(action.commit or "", action.host or "", action.began or "", action.ended or "", action.message),
            ]
        )
    return text.getvalue()


def _paths(artifacts: tuple[Artifact, ...]) -> str:
    return "\n".join(artifact.path for artifact in artifacts)


def _digests(artifacts: tuple[Artifact, ...]) -> str:
    return "\n".join(artifact.sha256 for artifact in artifacts)
