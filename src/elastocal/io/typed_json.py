"""Convert frozen dataclasses to JSON documents and back, and derive their JSON schema.

Supported field types are dataclasses, ``tuple[T, ...]``, tuples of fixed length,
``dict[str, T]``, unions, ``str``, ``bool``, ``int``, ``float``, ``None`` and ``Any``.
"""

from __future__ import annotations

from dataclasses import Field, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Any,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from elastocal.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Instance = TypeVar("Instance")

# Metadata of a field that a document lacks while the field has its default value.
OMITTED_BY_DEFAULT = {"omitted_by_default": True}
_SCALARS: dict[type, tuple[str, tuple[type, ...]]] = {
    str: ("string", (str,)),
    bool: ("boolean", (bool,)),
    int: ("integer", (int,)),
    float: ("number", (int, float)),
    NoneType: ("null", (NoneType,)),
}


def to_document(value: Any) -> Any:
    """Return a dataclass, with everything in it, as a JSON-serialisable document."""
    if is_dataclass(value):
        return {
            entry.name: to_document(getattr(value, entry.name))
            for entry in fields(value)
            if not _is_omitted(entry, getattr(value, entry.name))
        }
    if isinstance(value, dict):
        return {name: to_document(entry) for name, entry in value.items()}
    if isinstance(value, tuple | list):
        return [to_document(entry) for entry in value]
    return value


def from_document(
    cls: type[Instance], document: Mapping[str, Any], source: str | Path
) -> Instance:
    """Build a dataclass from its JSON document.

    Parameters
    ----------
    cls : type
        The dataclass.
    document : mapping
        As `to_document` returns it.
    source : str or path
        File of the document, for error messages.

    Raises
    ------
    InputError
        If a key is missing or unknown, or if a value has another type than its field.
    """
    instance: Instance = _from_value(cls, document, source, "")
    return instance


def build_json_schema(cls: type) -> dict[str, Any]:
    """Return the JSON schema of a dataclass, with one definition for each class."""
    definitions: dict[str, Any] = {}
    reference = _schema_of(cls, definitions)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **reference,
        "$defs": definitions,
    }


def _is_omitted(entry: Field[Any], value: Any) -> bool:
    return "omitted_by_default" in entry.metadata and value == entry.default


def _is_required(entry: Field[Any]) -> bool:
    return "omitted_by_default" not in entry.metadata


# The hints of a class are resolved once: each document has many of its instances.
_resolve_hints = cache(get_type_hints)


def _from_value(expected: Any, value: Any, source: str | Path, key: str) -> Any:
    """Check a value against a type and build the type's dataclasses from it."""
    if expected is Any:
        return value
    origin = get_origin(expected)
    if origin in (Union, UnionType):
        member = _choose_member(get_args(expected), value, source, key)
        return _from_value(member, value, source, key)
    if is_dataclass(expected):
        return _from_mapping(expected, value, source, key)
    if origin is tuple:
        return _from_list(get_args(expected), value, source, key)
    if origin is dict:
        _check(isinstance(value, dict), value, "a mapping", source, key)
        entry_type = get_args(expected)[1]
        return {
            name: _from_value(entry_type, entry, source, _join(key, name))
            for name, entry in value.items()
        }
    _check(_is_scalar(expected, value), value, _SCALARS[expected][0], source, key)
    return value


def _from_mapping(cls: Any, value: Any, source: str | Path, key: str) -> Any:
    _check(isinstance(value, dict), value, "a mapping", source, key)
    required = {entry.name for entry in fields(cls) if _is_required(entry)}
    allowed = {entry.name for entry in fields(cls)}
    for name in sorted(required - value.keys()):
        raise InputError(source, _join(key, name), "nothing", "a value")
    for name in sorted(value.keys() - allowed):
        raise InputError(
            source, _join(key, name), "an unknown key", ", ".join(sorted(allowed))
        )
    hints = _resolve_hints(cls)
    return cls(
        **{
            name: _from_value(hints[name], entry, source, _join(key, name))
            for name, entry in value.items()
        }
    )


def _from_list(
    entry_types: tuple[Any, ...], value: Any, source: str | Path, key: str
) -> tuple[Any, ...]:
    _check(isinstance(value, list), value, "a list", source, key)
    if entry_types[-1] is Ellipsis:
        entry_types = entry_types[:1] * len(value)
    _check(
        len(value) == len(entry_types),
        value,
        f"a list of {len(entry_types)}",
        source,
        key,
    )
    return tuple(
        _from_value(entry_type, entry, source, f"{key}[{index}]")
        for index, (entry_type, entry) in enumerate(
            zip(entry_types, value, strict=True)
        )
    )


def _choose_member(
    members: tuple[Any, ...], value: Any, source: str | Path, key: str
) -> Any:
    """Return the member of a union that a value belongs to."""
    for member in members:
        if _fits(member, value):
            return member
    names = " or ".join(_name_type(member) for member in members)
    raise InputError(source, key, _shorten(value), names)


def _fits(member: Any, value: Any) -> bool:
    """Whether a value has a type on its outermost level.

    Dataclasses are distinguished by their keys.
    """
    if is_dataclass(member):
        if not isinstance(value, dict):
            return False
        required = {entry.name for entry in fields(member) if _is_required(entry)}
        return required <= value.keys() <= {entry.name for entry in fields(member)}
    if get_origin(member) is tuple:
        return isinstance(value, list)
    if get_origin(member) is dict:
        return isinstance(value, dict)
    return member is Any or _is_scalar(member, value)


def _is_scalar(expected: Any, value: Any) -> bool:
    """Whether a value has a scalar type; true and false are no numbers."""
    if isinstance(value, bool):
        return expected is bool
    return isinstance(value, _SCALARS[expected][1])


def _check(
    is_valid: bool,  # noqa: FBT001 - the outcome of the check before it
    value: Any,
    allowed: str,
    source: str | Path,
    key: str,
) -> None:
    if not is_valid:
        raise InputError(source, key, _shorten(value), allowed)


def _join(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name


def _shorten(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _name_type(member: Any) -> str:
    if member in _SCALARS:
        return _SCALARS[member][0]
    if is_dataclass(member):
        return str(getattr(member, "__name__", member))
    return "a list" if get_origin(member) is tuple else "a mapping"


def _schema_of(expected: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a type; classes are added to the definitions."""
    if expected is Any:
        return {}
    if expected in _SCALARS:
        return {"type": _SCALARS[expected][0]}
    if is_dataclass(expected):
        return _reference(expected, definitions)
    arguments = get_args(expected)
    if get_origin(expected) is dict:
        entry = _schema_of(arguments[1], definitions)
        return {"type": "object", "additionalProperties": entry}
    if get_origin(expected) is tuple and arguments[-1] is Ellipsis:
        return {"type": "array", "items": _schema_of(arguments[0], definitions)}
    members = [_schema_of(argument, definitions) for argument in arguments]
    if get_origin(expected) is tuple:
        return {
            "type": "array",
            "prefixItems": members,
            "minItems": len(members),
            "maxItems": len(members),
        }
    return {"anyOf": members}


def _reference(cls: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    if cls.__name__ not in definitions:
        # Reserve the name first, so that a class may contain itself.
        definitions[cls.__name__] = {}
        hints = _resolve_hints(cls)
        definitions[cls.__name__] |= {
            "type": "object",
            "description": (cls.__doc__ or "").strip().split("\n\n")[0],
            "properties": {
                entry.name: _schema_of(hints[entry.name], definitions)
                for entry in fields(cls)
            },
            "required": [entry.name for entry in fields(cls) if _is_required(entry)],
            "additionalProperties": False,
        }
    return {"$ref": f"#/$defs/{cls.__name__}"}
