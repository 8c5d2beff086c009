"""config/config.yaml: defaults, refusals, nothing executed, and no drift from the parameter models."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from rahas.errors import ExpeditionError
from rahas.params import Config
from rahas.stores.config import generate_default_yaml, generate_schema, read_config, write_defaults

ROOT = Path(__file__).resolve().parents[2]


def read(folder: Path, text: str | bytes) -> Config:
    (folder / "config").mkdir(exist_ok=True)
    (folder / "config" / "config.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_config(folder)


@pytest.mark.parametrize("text", ["", "\n# nothing\n", "---\n", "\ufeff", "ingest:\n", "ingest: {}\nphase:\n"])
def test_absent_or_empty_is_the_default(tmp_path: Path, text: str) -> None:
    assert read_config(tmp_path) == Config()
    assert read(tmp_path, text) == Config()


def test_values_are_taken(tmp_path: Path) -> None:
    config = read(tmp_path, "ingest:\n  frame_rate: 12.5\ncapture_review:\n  max_jitter_px: 1e-1\n")
    assert config.ingest.frame_rate == 12.5
    assert config.capture_review.max_jitter_px == 0.1
    assert config.timeline == Config().timeline


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("ingest:\n  frame_rat: 3\n", ["line 2", "ingest.frame_rat", "unknown key", "is it frame_rate?"]),
        ("digest:\n  x: 3\n", ["line 1", "key digest", "unknown key", "is it ingest?"]),
        ("\ncapture_review:\n  min_object_span: 1.5\n", ["line 3", "min_object_span", "read 1.5", "≥ 0 and ≤ 1"]),
        ("capture_review: {max_jitter_px: .nan}", ["max_jitter_px", "read nan", "a number > 0"]),
        ("capture_review: {max_jitter_px: .inf}", ["max_jitter_px", "read inf", "a number > 0"]),
        ("capture_review: {max_jitter_px: yes}", ["max_jitter_px", "read True", "a number > 0"]),
        ("capture_review: {max_jitter_px: one}", ["max_jitter_px", "read 'one'", "a number > 0"]),
        ("capture_review: {max_jitter_px: [1, 2]}", ["max_jitter_px", "read [1, 2]"]),
        ("capture_review: {max_jitter_px: }", ["max_jitter_px", "read None"]),
        ("phase: {method: magic}", ["phase.method", "read 'magic'", "thesis"]),
        ("ingest: 3", ["key ingest", "read 3", "keys and values"]),
        ("- 1\n- 2\n", ["read [1, 2]", "expected sections"]),
        ("ingest: {frame_rate: 1}\ningest: {}\n", ["line 2", "key ingest", "twice"]),
        ("ingest:\n\tframe_rate: 1\n", ["line 2", "expected YAML"]),
        ("a: &a [1]\nb: *a\n", ["line 2", "alias"]),
        ("? [1]\n: 2\n", ["line 1", "no word"]),
        ("__use_yte__: true\n", ["__use_yte__", "unknown key"]),
        ("a: 1\n---\nb: 2\n", ["line 2", "expected YAML"]),
        ("when: 2009-99-99\n", ["expected plain values"]),
        ("[" * 5000 + "]" * 5000, ["nested without end"]),
        (b"ingest:\n  frame_rate: 1 # caf\xe9\n", ["line 2", "0xe9", "UTF-8"]),
        (b"#" * (1 << 21), ["expected at most"]),
    ],
)
def test_refused_with_place_read_and_expected(tmp_path: Path, text: str | bytes, said: list[str]) -> None:
    with pytest.raises(ExpeditionError) as caught:
        read(tmp_path, text)
    for part in ["config/config.yaml", *said]:
        assert part in str(caught.value), str(caught.value)


def test_all_faults_are_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(ExpeditionError) as caught:
        read(tmp_path, "ingest: {frame_rate: -1, x: 2}\ntimeline: {scan_threshold_rad: true}\ncloud: []\nfoo: 1\n")
    lines = str(caught.value).splitlines()
    keys = sorted(line.split(": read")[0].split("key ")[1] for line in lines)
    assert keys == ["cloud", "foo", "ingest.frame_rate", "ingest.x", "timeline.scan_threshold_rad"]


def test_nothing_in_it_is_run(tmp_path: Path) -> None:
    victim = tmp_path / "touched"
    for tag in ("!!python/object/apply:os.system", "!!python/object/new:os.system", "!!python/name:os.system"):
        with pytest.raises(ExpeditionError):
            read(tmp_path, f"ingest: {tag} ['touch {victim}']\n")
    assert not victim.exists()


def test_the_default_file_changes_nothing_and_names_every_key(tmp_path: Path) -> None:
    text = generate_default_yaml()
    assert read(tmp_path, text) == Config()
    uncommented = "\n".join(line.replace("  # ", "  ", 1) for line in text.splitlines() if not _is_remark(line))
    values = {section: keys or {} for section, keys in yaml.safe_load(uncommented).items()}
    assert values == Config().model_dump(mode="json"), "each commented key stands there with its default"


def _is_remark(line: str) -> bool:
    known = {key for section in Config.model_fields for key in type(getattr(Config(), section)).model_fields}
    return line.startswith("#") or (line.startswith("  # ") and line[4:].split(":")[0] not in known)


def test_the_schema_takes_the_default_file_and_refuses_what_the_models_refuse() -> None:
    schema = generate_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(yaml.safe_load(generate_default_yaml()), schema)
    for wrong in ({"digest": {}}, {"ingest": {"frame_rat": 1}}, {"capture_review": {"min_object_span": 2}}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, schema)


def test_the_files_of_the_repository_have_not_drifted(tmp_path: Path) -> None:
    write_defaults(tmp_path)
    for name in ("config.yaml", "config.schema.json"):
        kept = (ROOT / "config" / name).read_text(encoding="utf-8")
        assert kept == (tmp_path / "config" / name).read_text(encoding="utf-8"), (
            f"config/{name} is generated: run python -m rahas.stores.config ."
        )
    json.loads((ROOT / "config" / "config.schema.json").read_text(encoding="utf-8"))


@settings(max_examples=80, deadline=None)
@given(text=st.one_of(st.text(max_size=80), st.binary(max_size=80)))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str | bytes) -> None:
    folder = tmp_path_factory.mktemp("expedition")
    refusal = ""
    try:
        read(folder, text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"))
    except ExpeditionError as error:
        refusal = str(error)
    assert refusal == "" or "config/config.yaml" in refusal
