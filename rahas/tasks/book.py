"""config/simulation.yaml, read and checked; before a run where a row's capture has to be rendered from it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from rahas.errors import ExpeditionError
from rahas.simulate.book import SimulationBook
from rahas.simulate.specs import CaptureSpec
from rahas.stores.plain_yaml import PlainYamlError, parse_plain_yaml


def read_capture_spec(spec_path: Path, scan_id: str) -> CaptureSpec:
    """The specification of one capture of a simulation book.

    Raises
    ------
    ExpeditionError
        There is no such file, it is no simulation book, or it does not hold the capture.
    """
    return _capture(read_book(spec_path, scan_id), spec_path, scan_id)


def check_book(spec_path: Path, scan_ids: list[str]) -> None:
    """See that all of ``scan_ids`` can be rendered.

    Raises
    ------
    ExpeditionError
        As :func:`read_capture_spec`; what is wrong with several captures is told in one go.
    """
    if not scan_ids:
        return
    book = read_book(spec_path, scan_ids[0])
    faults = []
    for scan_id in scan_ids:
        try:
            _capture(book, spec_path, scan_id)
        except ExpeditionError as error:
            faults.append(str(error))
    if faults:
        raise ExpeditionError("\n".join(faults))


def read_book(spec_path: Path, scan_id: str) -> SimulationBook:
    """The whole book, which ``scan_id`` is to be rendered from; raises as :func:`read_capture_spec`."""
    shown = _shown(spec_path)
    try:
        value, lines = parse_plain_yaml(spec_path.read_bytes())
    except FileNotFoundError:
        raise ExpeditionError(
            f"{shown}: found no such file, expected it because {scan_id} is to be rendered from it"
        ) from None
    except PlainYamlError as error:
        raise ExpeditionError(f"{shown}{error}") from None
    try:
        return SimulationBook.model_validate(value)
    except ValidationError as error:
        raise ExpeditionError("\n".join(_fault(shown, one, lines) for one in error.errors())) from None


def _capture(book: SimulationBook, spec_path: Path, scan_id: str) -> CaptureSpec:
    try:
        return book.capture(scan_id)
    except ValueError as error:
        raise ExpeditionError(f"{_shown(spec_path)}, {error}") from None


def _fault(shown: str, error: Mapping[str, Any], lines: Mapping[tuple[str, ...], int]) -> str:
    path = tuple(str(part) for part in error["loc"])
    line = next((lines[path[:n]] for n in range(len(path), 0, -1) if path[:n] in lines), 1)
    if not path:
        return f"{shown}: {error['msg']}"
    return f"{shown}, line {line}, key {'.'.join(path)}: read {error['input']!r:.80}, {error['msg']}"


def _shown(spec_path: Path) -> str:
    return f"{spec_path.parent.name}/{spec_path.name}"
