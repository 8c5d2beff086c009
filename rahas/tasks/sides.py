"""The two sides of a comparison: an expedition, a results folder, or a run of the history."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rahas.errors import ExpeditionError
from rahas.provenance.history import HISTORY, Run, read_run, runs
from rahas.provenance.states import RowState, rows_of_results, state_of_folder
from rahas.stores.layout import ScanFolder

LATEST = "latest"
_A_RUN = re.compile(r"\d{1,9}|-\d{1,9}")


@dataclass(frozen=True)
class Side:
    """One side: its rows, the state of each, and where its data lies (``None``: records only).

    ``expedition_results`` is where the definitions behind its code fingerprints are kept.
    """

    name: str
    rows: frozenset[str]
    state: Callable[[str], RowState]
    results: Path | None
    expedition_results: Path
    made: Mapping[str, Any] = field(default_factory=dict)


def side_of(text: str, expedition: Path) -> Side:
    """The side that ``text`` names: a folder, else a run kept in the history of ``expedition``.

    Raises
    ------
    ExpeditionError
        There is no such folder or run, or a folder without results, or the run is damaged.
    """
    if Path(text).is_dir():
        return _folder(text)
    if text != LATEST and not _A_RUN.fullmatch(text):
        raise ExpeditionError(
            f"{text!r}: found no such folder, expected an expedition's folder, a results folder, or a run of "
            f"results/{HISTORY} such as 0003, {LATEST} or -1 (the one before the latest)"
        )
    return _run(text, expedition)


def _folder(text: str) -> Side:
    root = Path(text)
    results = root / "results" if (root / "results").is_dir() else root
    rows = rows_of_results(results)
    if not rows:
        raise ExpeditionError(f"{text}: found no results in it, expected results of at least one row of a field log")
    return Side(text, frozenset(rows), lambda scan_id: state_of_folder(ScanFolder(results, scan_id)), results, results)


def _run(text: str, expedition: Path) -> Side:
    run = _pick(text, runs(expedition / "results"), expedition)
    try:
        states = read_run(run.path)
        made = run.made
    except ValueError as error:
        raise ExpeditionError(str(error)) from None
    return Side(f"run {run.number:04d}", frozenset(states), states.__getitem__, None, expedition / "results", made)


def _pick(text: str, kept: list[Run], expedition: Path) -> Run:
    where = expedition / "results" / HISTORY
    if not kept:
        raise ExpeditionError(
            f"{text}: no run is kept in {where}; each `snakemake` run that changes something keeps one"
        )
    if text == LATEST or text.startswith("-"):
        back = 0 if text == LATEST else int(text[1:])
        if back < len(kept):
            return kept[-1 - back]
    else:
        for run in kept:
            if run.number == int(text):
                return run
    raise ExpeditionError(
        f"{text}: no such run in {where}; found {kept[0].number:04d} to {kept[-1].number:04d}, {len(kept)} in all"
    )
