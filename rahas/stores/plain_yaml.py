"""YAML as data only: no tags, no aliases, no key twice, and the line of every key."""

from __future__ import annotations

import re
from typing import Any

import yaml

LARGEST_FILE = 1 << 20
_FLOAT_WITHOUT_POINT = re.compile(r"^[-+]?[0-9]+[eE][-+]?[0-9]+$")


class PlainYamlError(ValueError):
    """Not plain YAML; the message starts with the place (``, line 3: …``)."""


class _Loader(yaml.SafeLoader):
    """The safe loader, with 1e-3 as the number that everybody means (YAML 1.1 wants 1.e-3)."""


_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT_WITHOUT_POINT, list("-+0123456789"))


def parse_plain_yaml(data: bytes) -> tuple[Any, dict[tuple[str, ...], int]]:
    """Parse one document; returns its value and the line (from 1) of every key by its path.

    Raises
    ------
    PlainYamlError
        Not UTF-8, too large, a syntax error, a tag, an alias, a key twice, or nesting without end.
    """
    if len(data) > LARGEST_FILE:
        raise PlainYamlError(f": read {len(data)} bytes, expected at most {LARGEST_FILE}")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise PlainYamlError(f", line {line}: read the byte 0x{data[error.start]:02x}, expected UTF-8") from None
    try:
        for event in yaml.parse(text, Loader=_Loader):
            if isinstance(event, yaml.AliasEvent):
                raise PlainYamlError(
                    f"{_place(event.start_mark)}: read the alias *{event.anchor}, expected plain values"
                )
        loader = _Loader(text)
        node = loader.get_single_node()
        lines: dict[tuple[str, ...], int] = {}
        if node is not None:
            _collect(node, (), lines)
        return (None if node is None else loader.construct_document(node)), lines
    except yaml.MarkedYAMLError as error:
        raise PlainYamlError(f"{_place(error.problem_mark)}: {error.problem}; expected YAML (key: value)") from None
    except yaml.YAMLError as error:
        raise PlainYamlError(f": {error}; expected YAML (key: value)") from None
    except RecursionError:
        raise PlainYamlError(": read values nested without end, expected sections with keys") from None
    except (ValueError, OverflowError) as error:  # a date such as 2009-99-99, a number that is none
        if isinstance(error, PlainYamlError):
            raise
        raise PlainYamlError(f": {error}; expected plain values") from None


def _collect(node: yaml.Node, path: tuple[str, ...], lines: dict[tuple[str, ...], int]) -> None:
    if isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            _collect(item, (*path, str(index)), lines)
    elif isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag != "tag:yaml.org,2002:str":
                raise PlainYamlError(f"{_place(key.start_mark)}: read a key that is no word, expected key: value")
            here = (*path, key.value)
            if here in lines:
                raise PlainYamlError(
                    f"{_place(key.start_mark)}, key {'.'.join(here)}: stands there twice, expected once"
                )
            lines[here] = key.start_mark.line + 1
            _collect(value, here, lines)


def _place(mark: Any) -> str:
    return f", line {mark.line + 1}" if mark else ""
