"""What differs between two recipes, in words: which function of which file, which parameter, input, column, library."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from rahas.provenance.records import Recipe

ABSENT = "absent"  # stands for a value that one of the two recipes does not have
_SHORT = 8
_MOST_NAMES = 3  # of one file that are told one by one


class Change(NamedTuple):
    """One difference between an old and a new recipe."""

    kind: str
    """``code``, ``parameter``, ``input``, ``column`` or ``library``."""
    name: str
    """``module:definition``, or the name of the parameter (sections joined by dots), input, column or library."""
    was: Any
    """Its old value or digest; :data:`ABSENT` where there was none."""
    now: Any
    """Its new value or digest; :data:`ABSENT` where there is none."""
    text: str
    """The same in words, one line."""


def changes(
    old: Recipe,
    new: Recipe,
    *,
    old_code: Mapping[str, str] | None = None,
    new_code: Mapping[str, str] | None = None,
) -> list[Change]:
    """List the differences of two recipes of a stage; empty where they are equal.

    ``old_code`` and ``new_code`` are the digests of each definition behind the two code fingerprints, by
    ``module:name`` (:func:`rahas.provenance.code.known_definitions`, ``CodeBase.definitions``). Without one of them
    a change of code is told, but not where it is.
    """
    found = list(_code_changes(old.code, new.code, old_code, new_code))
    parameters = {"parameter": (flattened(old.params), flattened(new.params))}
    others = {
        "input": (old.inputs, new.inputs),
        "column": (flattened(old.columns), flattened(new.columns)),
        "library": (old.libraries, new.libraries),
    }
    for kind, (before, after) in (parameters | others).items():
        for name in sorted({*before, *after}):
            was, now = before.get(name, ABSENT), after.get(name, ABSENT)
            if was != now:
                found.append(Change(kind, name, was, now, _TEXTS[kind](name, was, now)))
    return found


def flattened(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as one level, names joined by dots."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping) and value:
            flat |= flattened(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = value
    return flat


def shown_digest(digest: str) -> str:
    """The first characters of a digest; what an input's name is followed by (``none photo.jpg``) stays as it is."""
    *words, last = digest.split(" ")
    is_digest = len(last) == 64 and all(c in "0123456789abcdef" for c in last)
    return " ".join((*words, last[:_SHORT] if is_digest else last))


def _code_changes(was: str, now: str, old: Mapping[str, str] | None, new: Mapping[str, str] | None) -> Iterator[Change]:
    if was == now:
        return
    edited = [] if old is None or new is None else [n for n in sorted({*old, *new}) if old.get(n) != new.get(n)]
    if not edited or old is None or new is None:
        which = "which function is not known: its definitions were not kept"
        yield Change("code", "", was, now, f"the code changed ({was[:_SHORT]} before, {now[:_SHORT]} now; {which})")
        return
    for name in edited:
        before, after = old.get(name, ABSENT), new.get(name, ABSENT)
        what = _happened(before, after, many=name.endswith(":"))
        yield Change("code", name, before, after, f"code: {described(name)} {what}")


def in_words(found: Sequence[Change]) -> str:
    """Changes in one line; of one file with many changed definitions the number and the first names."""
    by_file: dict[tuple[str, str], list[Change]] = {}
    for change in found:
        if change.kind == "code" and change.name:
            by_file.setdefault((_file(change.name), _happened(change.was, change.now)), []).append(change)
    texts: dict[str, None] = {}
    for change in found:
        alike = by_file.get((_file(change.name), _happened(change.was, change.now)), []) if change.name else []
        if change.kind != "code" or len(alike) <= _MOST_NAMES:
            texts[change.text] = None
            continue
        names = ", ".join(name for one in alike if (name := one.name.partition(":")[2]))
        file, what = _file(change.name), _happened(change.was, change.now, many=True)
        texts[f"code: {len(alike)} definitions of {file} {what} ({shortened(names)})"] = None
    return "; ".join(texts)


def shortened(names: str, most: int = 60) -> str:
    """A list of names cut between two of them, with … where it was."""
    return names if len(names) <= most else names[:most].rpartition(", ")[0] + ", …"


def _file(definition: str) -> str:
    return definition.partition(":")[0].replace(".", "/") + ".py"


def _happened(was: Any, now: Any, *, many: bool = False) -> str:
    be = ("are", "were") if many else ("is", "was")
    return f"{be[0]} new" if was == ABSENT else f"{be[0]} no longer used" if now == ABSENT else f"{be[1]} edited"


def described(definition: str) -> str:
    """``function fit of rahas/kernels/banding.py`` from ``rahas.kernels.banding:fit``."""
    file, name = _file(definition), definition.partition(":")[2]
    if not name:
        return f"statements at the top level of {file}"
    bare = name.lstrip("_")
    kind = "constant" if bare.isupper() else "class" if bare[:1].isupper() else "function"
    return f"{kind} {name} of {file}"


def _parameter(name: str, was: Any, now: Any) -> str:
    return f"parameter {name}: {_values(was, now)}"


def _column(name: str, was: Any, now: Any) -> str:
    return f"column {name} of the log: {_values(was, now)}"


def _library(name: str, was: Any, now: Any) -> str:
    return f"library {name}: " + (f"{was} → {now}" if ABSENT not in (was, now) else _values(was, now))


def _input(name: str, was: Any, now: Any) -> str:
    if was == ABSENT:
        return f"input {name}: was not read before"
    if now == ABSENT:
        return f"input {name}: is no longer read"
    if was.startswith("none"):
        return f"input {name}: there was none, now there is"
    if now.startswith("none"):
        return f"input {name}: is gone"
    return f"input {name}: other content ({shown_digest(was)} → {shown_digest(now)})"


def _values(was: Any, now: Any) -> str:
    if was == ABSENT:
        return f"new ({_shown(now)})"
    if now == ABSENT:
        return f"no longer read (was {_shown(was)})"
    return f"{_shown(was)} → {_shown(now)}"


def _shown(value: Any) -> str:
    short = shown_digest(value) if isinstance(value, str) else value
    return short if short != value else repr(value)


_TEXTS = {"parameter": _parameter, "column": _column, "library": _library, "input": _input}
