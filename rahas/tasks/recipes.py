"""Recipes of what is made outside the stage table: a scan's verdict and page, the index, a rendered capture."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rahas.provenance.fingerprints import package_code
from rahas.provenance.records import Recipe, library_versions
from rahas.stores.digests import digest_of_json, digest_of_path
from rahas.tasks.pipeline import STAGES, Work
from rahas.tasks.plan import PAGE_ENTRY, SIMULATE_ENTRY, SUMMARY_ENTRY, VERDICT_ENTRY, row_of, templates_digest

if TYPE_CHECKING:
    from rahas.report.pages import Card


def verdict_recipe(work: Work, problem: Any) -> Recipe:
    """Of ``qa.json``; ``problem`` is the reason of a stage that could not go on, else None."""
    entry, scan = work.entry, work.scan
    read = (scan.capture_review, scan.result_review, scan.calibration)
    return Recipe(
        stage="verdict",
        inputs={p.name: digest_of_path(p) for p in read if p.exists()},
        columns={"decision": entry.decision, "role": entry.role},
        params={"included": entry.scan_id in work.expedition.include_rejected, "problem": problem},
        code=package_code().fingerprint(VERDICT_ENTRY),
        libraries={},
    )


def page_recipe(work: Work) -> Recipe:
    """Of ``report.html`` and ``figures/``."""
    scan = work.scan
    read = [p for name in STAGES for p in STAGES[name].outputs(scan) if p.exists()]
    return Recipe(
        stage="page",
        inputs={str(p.relative_to(scan.path)): digest_of_path(p) for p in (*read, scan.qa)},
        columns=row_of(work.entry),
        params={"templates": templates_digest()},
        code=package_code().fingerprint(PAGE_ENTRY),
        libraries=library_versions("jinja2", "opencv-python-headless"),
    )


def summary_recipe(cards: Iterable[Card]) -> Recipe:
    """Of the expedition's index and table."""
    cards = list(cards)
    return Recipe(
        stage="summary",
        inputs={card.row["scan_id"]: digest_of_json([card.qa, card.thumbnail, card.link]) for card in cards},
        columns={card.row["scan_id"]: dict(card.row) for card in cards},
        params={"templates": templates_digest(), "order": [card.row["scan_id"] for card in cards]},
        code=package_code().fingerprint(SUMMARY_ENTRY),
        libraries=library_versions("jinja2"),
    )


def render_recipe(spec_path: Path, scan_id: str) -> Recipe:
    """Of a rendered capture, its texture photo and its truth.

    Raises
    ------
    ExpeditionError
        The simulation book does not hold it.
    """
    from rahas.tasks.book import read_capture_spec

    return Recipe(
        stage="render",
        inputs={},
        columns={},
        params=read_capture_spec(spec_path, scan_id).model_dump(mode="json"),
        code=package_code().fingerprint(SIMULATE_ENTRY),
        libraries=library_versions("numpy", "scipy", "numba", "av", "opencv-python-headless"),
    )
