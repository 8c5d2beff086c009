"""config/config.yaml: read without running anything, checked against the parameter models, generated from them.

``python -m rahas.stores.config EXPEDITION`` writes the default file and its JSON schema.
"""

from __future__ import annotations

import difflib
import json
import sys
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from rahas.errors import ExpeditionError
from rahas.params import Config
from rahas.stores.atomic import write_text
from rahas.stores.csv_table import shown
from rahas.stores.plain_yaml import PlainYamlError, parse_plain_yaml

CONFIG = "config/config.yaml"
SCHEMA = "config/config.schema.json"


def read_config(expedition: Path) -> Config:
    """Read ``config/config.yaml`` of an expedition; an absent or an empty file gives the defaults.

    Raises
    ------
    ExpeditionError
        All that is wrong: file, line, key, what was read and what is expected.
    """
    path = expedition / CONFIG
    if not path.exists():
        return Config()
    try:
        values, lines = parse_plain_yaml(path.read_bytes())
    except PlainYamlError as error:
        raise ExpeditionError(f"{CONFIG}{error}") from None
    except IsADirectoryError:
        raise ExpeditionError(f"{CONFIG}: read a folder, expected a file") from None
    if values is None:
        return Config()
    if not isinstance(values, dict):
        raise ExpeditionError(
            f"{CONFIG}, line 1: read {shown(values)}, expected sections: {', '.join(Config.model_fields)}"
        )
    faults = [
        _fault(lines, (section,), keys, "keys and values below this section")
        for section, keys in values.items()
        if section in Config.model_fields and keys is not None and not isinstance(keys, dict)
    ]
    sections = {section: {} if keys is None else keys for section, keys in values.items()}
    faults += [
        _fault(lines, (section, key), value, _expected(Config, (section, key)))
        for section, keys in sections.items()
        if section in Config.model_fields and isinstance(keys, dict)
        for key, value in keys.items()
        if isinstance(value, bool) and not _takes_bool(_field_at(Config, (section, key)))
    ]
    try:
        config = Config.model_validate(sections)
    except ValidationError as error:
        for fault in _faults_of(error, lines):
            if fault.split(": read")[0] not in {known.split(": read")[0] for known in faults}:
                faults.append(fault)
    if faults:
        raise ExpeditionError("\n".join(faults))
    return config


def generate_default_yaml() -> str:
    """The default file: every key with its meaning, commented out, so that the file as it is changes nothing."""
    text = [
        f"# yaml-language-server: $schema={Path(SCHEMA).name}",
        "# Parameters of the expedition. Every default is good enough to run: take the # from the lines to change.",
    ]
    for name, info in Config.model_fields.items():
        section = info.annotation
        if not (isinstance(section, type) and issubclass(section, BaseModel)):
            raise TypeError(f"{name} of Config is no section of parameters")
        text += ["", f"# {_first_line(section)}", f"{name}:"]
        for key, field in section.model_fields.items():
            default = json.dumps(field.get_default(call_default_factory=True), default=str, ensure_ascii=False)
            text += [f"  # {_meaning(field)}", f"  # {key}: {default}"]
    return "\n".join(text) + "\n"


def generate_schema() -> dict[str, Any]:
    """JSON schema of config.yaml, for editors and checks; a section may be left empty."""
    schema = Config.model_json_schema()
    for name, section in schema["properties"].items():
        reference = section.pop("$ref", None)
        if reference:
            section["anyOf"] = [{"$ref": reference}, {"type": "null"}]
        schema["properties"][name] = section
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "RAHAS config.yaml", **schema}


def write_defaults(expedition: Path) -> None:
    """Write the default config.yaml and its schema into an expedition's config folder."""
    write_text(expedition / CONFIG, generate_default_yaml())
    write_text(expedition / SCHEMA, json.dumps(generate_schema(), indent=1, ensure_ascii=False) + "\n")


def _faults_of(error: ValidationError, lines: dict[tuple[str, ...], int]) -> list[str]:
    faults = []
    for detail in error.errors(include_url=False):
        path = tuple(str(part) for part in detail["loc"])
        if detail["type"] == "extra_forbidden":
            faults.append(_unknown_key(lines, path))
        else:
            faults.append(_fault(lines, path, detail["input"], _expected(Config, path) or detail["msg"]))
    return faults


def _fault(lines: dict[tuple[str, ...], int], path: tuple[str, ...], read: object, expected: str) -> str:
    line = next((lines[path[:n]] for n in range(len(path), 0, -1) if path[:n] in lines), 1)
    return f"{CONFIG}, line {line}, key {'.'.join(path)}: read {shown(read)}, expected {expected}"


def _unknown_key(lines: dict[tuple[str, ...], int], path: tuple[str, ...]) -> str:
    model = Config if len(path) == 1 else _model_of(_field_at(Config, path[:-1]))
    known = list(model.model_fields) if model else []
    close = difflib.get_close_matches(path[-1], known, n=1)
    hint = f" (is it {close[0]}?)" if close else ""
    return (
        f"{CONFIG}, line {lines.get(path, 1)}, key {'.'.join(path)}: read an unknown key{hint}, "
        f"expected one of {', '.join(known) or 'none: this section has no keys'}"
    )


def _field_at(model: type[BaseModel] | None, path: tuple[str, ...]) -> FieldInfo | None:
    field = None
    for part in path:
        field = model.model_fields.get(part) if model else None
        model = _model_of(field)
    return field


def _model_of(field: FieldInfo | None) -> type[BaseModel] | None:
    kind = field.annotation if field else None
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None


def _takes_bool(field: FieldInfo | None) -> bool:
    return field is None or field.annotation is bool or bool in get_args(field.annotation)


def _expected(model: type[BaseModel], path: tuple[str, ...]) -> str:
    """What a key takes, in words: kind, range, choices and meaning; empty where the models say nothing."""
    field = _field_at(model, path)
    return _meaning(field) if field else ""


def _meaning(field: FieldInfo) -> str:
    schema = _schema_of(field)
    kinds = [_kind(part) for part in schema.get("anyOf", [schema])]
    return f"{' '.join((field.description or 'a value').split())} ({' or '.join(kinds)})"


def _schema_of(field: FieldInfo) -> dict[str, Any]:
    return TypeAdapter(field.rebuild_annotation()).json_schema()


def _kind(schema: dict[str, Any]) -> str:
    names = {"number": "a number", "integer": "a whole number", "boolean": "true or false", "null": "null"}
    if "enum" in schema:
        return "one of " + ", ".join(map(str, schema["enum"]))
    if "const" in schema:
        return f"always {schema['const']}"
    bounds = {"exclusiveMinimum": "> {}", "minimum": "≥ {}", "exclusiveMaximum": "< {}", "maximum": "≤ {}"}
    limits = [text.format(f"{schema[name]:g}") for name, text in bounds.items() if name in schema]
    kind = names.get(schema.get("type", ""), schema.get("type", "a value"))
    return " ".join([kind, " and ".join(limits)]).strip()


def _first_line(model: type[BaseModel]) -> str:
    return (model.__doc__ or "").strip().splitlines()[0]


if __name__ == "__main__":
    write_defaults(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
