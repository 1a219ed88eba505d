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

from elastocal.io.documents import make_violation_error

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Instance = TypeVar("Instance")

# Metadata of a field that a document lacks while the field has its default value.
OMITTED_BY_DEFAULT = {"omitted_by_default": True}
_SCALARS = {
    str: "string",
    bool: "boolean",
    int: "integer",
    float: "number",
    NoneType: "null",
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
    from jsonschema.exceptions import best_match

    expected: Any = cls
    error = best_match(_make_validator(expected).iter_errors(document))
    if error is not None:
        raise make_violation_error(source, error)
    instance: Instance = _build(cls, document)
    return instance


def build_json_schema(cls: Any) -> dict[str, Any]:
    """Return the JSON schema of a type, with one definition for each dataclass."""
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


@cache
def _make_validator(expected: Any) -> Any:
    """Return the validator of a type."""
    from jsonschema import Draft202012Validator

    return Draft202012Validator(build_json_schema(expected))


def _build(expected: Any, value: Any) -> Any:
    """Build the dataclasses of a type from a value that its schema allows."""
    origin = get_origin(expected)
    arguments = get_args(expected)
    if is_dataclass(expected):
        return _build_instance(expected, value)
    if origin is dict:
        return {name: _build(arguments[1], entry) for name, entry in value.items()}
    if origin is tuple:
        if arguments[-1] is Ellipsis:
            arguments = arguments[:1] * len(value)
        return tuple(map(_build, arguments, value))
    if origin in (Union, UnionType) and value is not None:
        members = [member for member in arguments if member is not NoneType]
        if len(members) > 1:
            members = [
                member for member in members if _make_validator(member).is_valid(value)
            ]
        return _build(members[0], value)
    return value


def _build_instance(cls: Any, document: Mapping[str, Any]) -> Any:
    hints = _resolve_hints(cls)
    entries = {name: _build(hints[name], entry) for name, entry in document.items()}
    return cls(**entries)


def _schema_of(expected: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a type; classes are added to the definitions."""
    if expected is Any:
        return {}
    if expected in _SCALARS:
        return {"type": _SCALARS[expected]}
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
