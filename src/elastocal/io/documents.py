"""YAML documents that users write: read, and checked against a JSON schema that knows every key."""

from __future__ import annotations

import difflib
import math
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import jsonschema
import yaml

from elastocal.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Any, Protocol

    class _Violation(Protocol):
        """An error of jsonschema, of which a validator sets every part."""

        absolute_path: Iterable[str | int]
        validator: str
        validator_value: Any
        schema: dict[str, Any]
        instance: Any
        message: str


# The safe loader, in C where libyaml is there: the study is read at every call of snakemake.
class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Safe, and a date stays the text that it is in the file."""

    yaml_implicit_resolvers: ClassVar = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


# Stricter than JSON, which has no NaN and no infinity and takes 10.0 for an integer.
_Validator = jsonschema.validators.extend(
    jsonschema.Draft202012Validator,
    type_checker=jsonschema.Draft202012Validator.TYPE_CHECKER.redefine_many(
        {
            "integer": lambda _, value: isinstance(value, int) and not isinstance(value, bool),
            "number": lambda _, value: isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value),
        }
    ),
)

_NOT_XML = "YAML; a URDF becomes a robot file by `elastocal import urdf FILE --base LINK --tip LINK --output robot.yaml`"


def read_document(path: str | Path) -> Any:
    """Contents of a YAML file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    object

    Raises
    ------
    InputError
        A file that is missing or is no YAML, such as a URDF.
    """
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read()
        if text.lstrip("\ufeff \r\n\t").startswith("<"):
            raise InputError(path, "", "XML", _NOT_XML)
        return yaml.load(text, Loader=_Loader)
    except OSError as error:
        raise InputError(path, "", error.strerror or str(error), "a readable file") from None
    except UnicodeDecodeError as error:
        raise InputError(path, f"byte {error.start}", "text that is not UTF-8", "a UTF-8 file") from None
    except yaml.YAMLError as error:
        line = getattr(getattr(error, "problem_mark", None), "line", None)
        where = "" if line is None else f"line {line + 1}"
        raise InputError(path, where, getattr(error, "problem", None) or str(error), "YAML") from None


def one_line(value: Any) -> str:
    """A value as YAML on one line.

    Parameters
    ----------
    value : object

    Returns
    -------
    str
    """
    text: str = yaml.safe_dump(value, default_flow_style=True, width=math.inf, sort_keys=False, allow_unicode=True)
    return text.removesuffix("\n").removesuffix("\n...")


@cache
def read_schema(name: str) -> dict[str, Any]:
    """One of the package's schemas: ``config``, ``robot`` or ``strategy``."""
    text = resources.files("elastocal").joinpath("schemas", f"{name}.yaml").read_text(encoding="utf-8")
    return yaml.load(text, Loader=_Loader)


def check_document(document: Any, schema: str, source: str) -> None:
    """Check a document against a schema.

    Parameters
    ----------
    document : object
    schema : str
        Name of the schema, as in `read_schema`.
    source : str
        The document's file, named in errors.

    Raises
    ------
    InputError
        Names the first key at fault, what was found and what is allowed.
    """
    validator = _Validator(read_schema(schema))
    errors = sorted(validator.iter_errors(document), key=lambda error: [str(part) for part in error.absolute_path])
    if errors:
        raise InputError(source, *_explained(errors[0]))


def _explained(error: _Violation) -> tuple[str, str, str]:
    """Key, what was found and what is allowed, of one violation."""
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in error.absolute_path).lstrip(".")
    rule, value = error.validator, error.validator_value
    if rule == "additionalProperties":
        known = sorted(error.schema.get("properties", {}))
        unknown = next(name for name in error.instance if name not in known)
        close = difflib.get_close_matches(str(unknown), known, n=1)
        hint = f"{close[0]!r}?" if close else ""
        return f"{key}.{unknown}".lstrip("."), "an unknown key", f"{hint} ({', '.join(known)})".strip()
    if rule == "required":
        missing = next(name for name in value if name not in error.instance)
        return f"{key}.{missing}".lstrip("."), "nothing", error.schema["properties"][missing].get("description", "a value")
    meaning = error.schema.get("description", "")
    allowed = {
        "enum": lambda: " | ".join(map(str, value)),
        "type": lambda: f"{value}",
        "minimum": lambda: f"{value} or more",
        "exclusiveMinimum": lambda: f"more than {value}",
        "minItems": lambda: f"{value} or more entries",
        "maxItems": lambda: f"{value} or fewer entries",
        "uniqueItems": lambda: "each entry once",
    }.get(rule, lambda: error.message)()
    return key, repr(error.instance), f"{allowed} ({meaning})" if meaning else allowed


def document_path(folder: str | Path, kind: str, name: str) -> str:
    """Where a document stands that a configuration names: ``folder/kind/name.yaml``."""
    return (Path(folder) / kind / f"{name}.yaml").as_posix()


def named_document(folder: str | Path, kind: str, schema: str, name: str, source: str) -> dict[str, Any]:
    """Read and check a document that a configuration names.

    Parameters
    ----------
    folder : str or Path
    kind : str
        Subfolder: robots, strategies, campaigns.
    schema : str
        As in `check_document`.
    name : str
        Of the file, without its ending.
    source : str
        File that names it, for errors.

    Returns
    -------
    dict

    Raises
    ------
    InputError
        No such file, or a document that its schema refuses.
    """
    path = Path(document_path(folder, kind, name))
    if not path.is_file():
        known = sorted(file.stem for file in path.parent.glob("*.yaml"))
        close = difflib.get_close_matches(name, known, n=1)
        hint = f"{close[0]!r}? ({', '.join(known)})" if close else ", ".join(known)
        raise InputError(source, kind, repr(name), f"a file of {path.parent.as_posix()}: {hint}")
    document = read_document(path)
    check_document(document, schema, path.as_posix())
    return document
