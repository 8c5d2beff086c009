"""A fingerprint changes with the code that a stage reaches, and with nothing else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rahas.provenance.fingerprints import CodeBase, package_code
from rahas.tasks.pipeline import STAGES

FILES = {
    "tasks/one.py": '''"""Task one."""
from rahas.kernels import far
from rahas.kernels.near import useful

LIMIT = 3


def run(x):
    """Doc."""
    # a comment
    return useful(x, LIMIT) + far.away(x)
''',
    "tasks/two.py": "from rahas.kernels.near import other\n\n\ndef run(x):\n    return other(x)\n",
    "kernels/near.py": "def useful(x, n):\n    return _inner(x) * n\n\n\ndef _inner(x):\n    return x\n\n\n"
    "def other(x):\n    return -x\n",
    "kernels/far.py": "def away(x):\n    def deep():\n        from rahas.kernels.late import later\n\n"
    "        return later(x)\n\n    return deep()\n",
    "kernels/late.py": "def later(x):\n    return x\n",
    "__init__.py": "",
    "kernels/__init__.py": "",
    "tasks/__init__.py": "",
}
ONE, TWO = "rahas.tasks.one:run", "rahas.tasks.two:run"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return tmp_path


def _changed(package: Path, edit: Callable[[], object]) -> tuple[bool, bool]:
    before = CodeBase(package)
    prints = before.fingerprint(ONE), before.fingerprint(TWO)
    edit()
    after = CodeBase(package)
    return prints[0] != after.fingerprint(ONE), prints[1] != after.fingerprint(TWO)


def _replace(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


@pytest.mark.parametrize(
    ("name", "old", "new", "expected"),
    [
        ("kernels/near.py", "return x\n", "return x + 1\n", (True, False)),  # a helper of a helper
        ("kernels/near.py", "return -x", "return -2 * x", (False, True)),
        ("kernels/late.py", "return x", "return x * 2", (True, False)),  # imported inside a nested function
        ("tasks/one.py", "LIMIT = 3", "LIMIT = 4", (True, False)),
        ("tasks/one.py", "# a comment", "# another", (False, False)),
        ("tasks/one.py", '"""Doc."""', '"""Another."""', (False, False)),
        ("tasks/one.py", "useful(x, LIMIT) + far", "useful(\n        x,\n        LIMIT,\n    ) + far", (False, False)),
        ("kernels/far.py", "def away(x):", "def unused():\n    return 1\n\n\ndef away(x):", (False, False)),
    ],
)
def test_edit(package: Path, name: str, old: str, new: str, expected: tuple[bool, bool]) -> None:
    assert _changed(package, lambda: _replace(package / name, old, new)) == expected


def test_real_stages_reach_their_kernels_and_not_each_others() -> None:
    code = package_code()
    reached = {name: {k.split(":")[0] for k in code.definitions(stage.entry)} for name, stage in STAGES.items()}
    assert "rahas.kernels.joint_steps" in reached["phase"]
    assert "rahas.kernels.triangulation" in reached["cloud"]
    assert "rahas.kernels.triangulation" not in reached["phase"]
    assert "rahas.kernels.joint_steps" not in reached["snakes"]
    for name, modules in reached.items():
        assert len(modules) > 2, name


def test_what_is_kept_of_the_source_gives_the_same_and_never_stands_in_for_an_edit(package: Path) -> None:
    cache = package / "kept.json"
    fresh = [CodeBase(package).fingerprint(entry) for entry in (ONE, TWO)]
    assert [CodeBase(package, cache=cache).fingerprint(entry) for entry in (ONE, TWO)] == fresh
    kept = cache.read_bytes() if cache.exists() else b""
    assert [CodeBase(package, cache=cache).fingerprint(entry) for entry in (ONE, TWO)] == fresh
    _replace(package / "kernels/near.py", "return x\n", "return x + 1\n")
    assert CodeBase(package, cache=cache).fingerprint(ONE) == CodeBase(package).fingerprint(ONE) != fresh[0]
    cache.write_bytes(kept[: len(kept) // 2])  # a torn write
    assert CodeBase(package, cache=cache).fingerprint(TWO) == fresh[1]
