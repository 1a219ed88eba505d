"""YAML documents that users write: read, and checked against a JSON schema that knows every key."""

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from itertools import islice
from pathlib import Path
from typing import Any, ClassVar

import yaml

from elastocal.errors import InputError, closest, closest_first, text_fault
from elastocal.io.texts import read_text

# Far above what people write by hand (no schema goes deeper than 7), and read in seconds whatever it holds.
LARGEST_BYTES, MOST_VALUES, DEEPEST = 300_000, 100_000, 20
# More digits are no number that anything here counts, and beyond 308 no floating-point number.
_MOST_DIGITS = 18
_DECIMAL = re.compile(
    rf"[-+]?(0|[1-9]\d{{0,{_MOST_DIGITS - 1}}})|[-+]?(\d+\.\d*|\.\d+)([eE][-+]\d+)?|[-+]?\.(inf|nan)", re.ASCII | re.IGNORECASE
)
# What some programs write and YAML 1.1 takes for a text.
_WITHOUT_POINT = re.compile(r"([-+]?\d+)(?:\.(\d*))?[eE]([-+]?)(\d+)", re.ASCII)
# Faults of one document that are looked at: it may hold a fault in each of its entries.
_MOST_FAULTS = 1000


class _UnclearError(yaml.MarkedYAMLError):
    """What people and YAML 1.1 read differently; `allowed` is what may stand there."""

    def __init__(self, mark: Any, found: str, allowed: str) -> None:
        super().__init__(problem=found, problem_mark=mark)
        self.allowed = allowed


# The safe loader, in C where libyaml is there: the study is read at every call of snakemake.
class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Safe; a date stays the text that it is in the file, each key stands once, and numbers are decimal."""

    yaml_implicit_resolvers: ClassVar = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """A mapping; of keys that stand there twice the last would win."""
        first: dict[str, yaml.Node] = {}
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and first.setdefault(key.value, key) is not key:
                line = first[key.value].start_mark.line + 1
                raise _UnclearError(key.start_mark, f"the key {key.value!r} again", f"each key once (first in line {line})")
        mapping: dict[Any, Any] = super().construct_mapping(node, deep)
        return mapping

    def construct_number(self, node: yaml.ScalarNode) -> int | float:
        """A decimal number; YAML 1.1 would read 1_0 as 10, 010 as 8 and 1:30 as 90."""
        if not _DECIMAL.fullmatch(node.value):
            allowed = f"a decimal number of at most {_MOST_DIGITS} digits, or in quotes what is a text"
            raise _UnclearError(node.start_mark, node.value, allowed)
        number: int | float = self.construct_yaml_float(node) if node.tag.endswith("float") else int(node.value)
        return number


for _kind in ("int", "float"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _Loader.construct_number)


@cache
def _validator(schema: str) -> Any:
    """Stricter than JSON, which has no NaN and no infinity and takes 10.0 for an integer."""
    import jsonschema

    def each_once(_: Any, wanted: bool, instance: Any, __: Any) -> Iterator[Exception]:
        """The rule uniqueItems in linear time: jsonschema compares each pair where numbers and lists are mixed."""
        if wanted and isinstance(instance, list):
            entries = [json.dumps(entry, default=str) for entry in instance]
            if len(set(entries)) < len(entries):
                yield jsonschema.ValidationError("an entry twice")

    def of_pattern(_: Any, pattern: str, instance: Any, __: Any) -> Iterator[Exception]:
        """The rule pattern; to Python, as to no other reader of a schema, the sign $ also means before a last line break."""
        if isinstance(instance, str) and not re.fullmatch(pattern, instance):
            yield jsonschema.ValidationError("another text")

    types = {
        "integer": lambda _, value: isinstance(value, int) and not isinstance(value, bool),
        "number": lambda _, value: isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value),
    }
    base = jsonschema.Draft202012Validator
    rules, checked = {"uniqueItems": each_once, "pattern": of_pattern}, base.TYPE_CHECKER.redefine_many(types)
    validator = jsonschema.validators.extend(base, rules, type_checker=checked)
    return validator(read_schema(schema), format_checker=jsonschema.FormatChecker(["date"]))


_NOT_XML = "YAML; a URDF becomes a robot file by `elastocal import urdf FILE --base LINK --tip LINK --output robot.yaml`"


def read_document(path: str | Path) -> Any:
    """Contents of a YAML file; one that is missing or `parsed` refuses is an InputError."""
    return parsed(read_text(path, LARGEST_BYTES), path)


def parsed(text: str, source: str | Path) -> Any:
    """Contents of a YAML text; an InputError names the line of what is no YAML, unclear or out of bounds, such as a URDF."""
    if text.lstrip("\ufeff \r\n\t").startswith("<"):
        raise InputError(source, "", "XML", _NOT_XML)
    try:
        _check_events(text)
        return yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        mark, allowed = getattr(error, "problem_mark", None), getattr(error, "allowed", "YAML")
        line, found = getattr(mark, "line", None), (getattr(error, "problem", None) or str(error))
        if isinstance(error, yaml.reader.ReaderError):
            line, found = text.count("\n", 0, error.position), f"the control character {chr(error.character)!r}"
        elif line is not None and mark and not isinstance(error, _UnclearError):
            here = "".join(text.splitlines()[line:][:1])[mark.column :][:40].strip()
            problem, _, wanted = found.partition("did not find expected ")
            shown = repr(here) if here else "the end of the line" if text.splitlines()[line + 1 :] else "the end of the text"
            found = shown if wanted else f"{problem.removeprefix('but ').removeprefix('found ')}: {shown}"
            allowed = f"YAML with {wanted} here" if wanted else allowed
        where = "" if line is None else f"line {line + 1}"
        raise InputError(source, where, found, allowed) from None


def _check_events(text: str) -> None:
    """Refuse what lets a small file grow beyond bounds or makes other objects than values, before anything is made of it."""
    # Of each open list or mapping its anchor, how many values it holds with all aliases written out, and how deep they go.
    sizes: dict[str, tuple[int, int]] = {}
    frames: list[tuple[str | None, int, int]] = [(None, 0, 0)]
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.CollectionStartEvent):
            frames.append((event.anchor, 0, 0))
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, count, height = frames.pop()
            sizes |= {} if anchor is None else {anchor: (count, height + 1)}
            frames[-1] = _enlarged(frames[-1], count, height + 1)
        elif isinstance(event, yaml.AliasEvent):
            if event.anchor not in sizes:
                raise _UnclearError(event.start_mark, f"the alias *{event.anchor} of what is not complete", "values")
            frames[-1] = _enlarged(frames[-1], *sizes[event.anchor])
        elif isinstance(event, yaml.ScalarEvent):
            sizes |= {} if event.anchor is None else {event.anchor: (1, 0)}
            frames[-1] = _enlarged(frames[-1], 1, 0)
        if isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent) and event.tag is not None:
            raise _UnclearError(event.start_mark, f"the tag {event.tag}", "values without tags")
        if len(frames) + frames[-1][2] - 1 > DEEPEST:
            raise _UnclearError(event.start_mark, "lists or keys in each other", f"at most {DEEPEST} deep")
        if frames[-1][1] > MOST_VALUES:
            allowed = f"at most {MOST_VALUES}, aliases written out"
            raise _UnclearError(event.start_mark, "more values than a document has", allowed)


def _enlarged(frame: tuple[str | None, int, int], count: int, height: int) -> tuple[str | None, int, int]:
    return frame[0], frame[1] + count, max(frame[2], height)


def one_line(value: Any) -> str:
    """A value as YAML on one line."""
    text: str = yaml.safe_dump(value, default_flow_style=True, width=math.inf, sort_keys=False, allow_unicode=True)
    return text.removesuffix("\n").removesuffix("\n...")


@cache
def read_schema(name: str) -> dict[str, Any]:
    """One of the package's schemas: ``config``, ``robot`` or ``strategy``."""
    text = resources.files("elastocal").joinpath("schemas", f"{name}.yaml").read_text(encoding="utf-8")
    return yaml.load(text, Loader=_Loader)


def check_document(document: Any, schema: str, source: str) -> None:
    """Check a document of the file `source` against a schema, as `read_schema` names it; the first key at fault is refused."""
    errors = islice(_validator(schema).iter_errors(document), _MOST_FAULTS)
    if error := min(errors, key=lambda error: [str(part) for part in error.absolute_path], default=None):
        key, found, allowed = _explained(error)
        path = [*error.absolute_path]
        if error.validator == "additionalProperties":
            path.append(next(name for name in error.instance if name not in error.schema.get("properties", {})))
        line = _line_of(source, path)
        raise InputError(source, ", ".join(part for part in (line, key) if part), found, allowed)
    for place, text in _texts(document):
        # White space between the transforms of a chain is free; headers of another table are nobody's names.
        if fault := None if place[:1] == ("columns",) else text_fault(" ".join(text.split()) if place == ("chain",) else text):
            key, line = _key_of(place), _line_of(source, place)
            raise InputError(source, ", ".join(part for part in (line, key) if part), *fault)


def _texts(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """All texts of a document, keys among them, and where each stands."""
    if isinstance(value, str):
        yield path, value
    for key, each in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        if isinstance(key, str):
            yield (*path, key), key
        yield from _texts(each, (*path, key))


def _line_of(source: str, path: Sequence[str | int]) -> str:
    """Line of the file at which a key stands, or what it should stand in; empty where there is no such file any more."""
    try:
        node = yaml.compose(read_text(source, LARGEST_BYTES), Loader=_Loader)
    except (InputError, yaml.YAMLError):
        return ""
    mark = node.start_mark if node else None
    for part in path:
        if isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
            mark = node.start_mark
            continue
        entries = node.value if isinstance(node, yaml.MappingNode) else []
        entry = next(((key, value) for key, value in entries if key.value == str(part)), None)
        if entry is None:
            # Such as a value of the command line, which the file does not have.
            return ""
        mark, node = entry[0].start_mark, entry[1]
    return f"line {mark.line + 1}" if mark and path else ""


_BOUNDS = {
    "minimum": "{} or more",
    "exclusiveMinimum": "more than {}",
    "maximum": "{} or less",
    "exclusiveMaximum": "less than {}",
}


def _key_of(path: Iterable[str | int]) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".")


def _explained(error: Any) -> tuple[str, str, str]:
    """Key, what was found and what is allowed, of one violation."""
    key = _key_of(error.absolute_path)
    rule, value = error.validator, error.validator_value
    if rule == "additionalProperties":
        known = sorted(error.schema.get("properties", {}))
        unknown = next(name for name in error.instance if name not in known)
        return f"{key}.{unknown}".lstrip("."), "an unknown key", f"{closest(unknown, known)} ({', '.join(known)})".strip()
    if rule == "required":
        missing = next(name for name in value if name not in error.instance)
        wanted = error.schema["properties"][missing]
        kind, meaning = wanted.get("type"), wanted.get("description", "")
        words = [_of_type(kind, None) if kind else "", *_bounds(wanted)]
        return f"{key}.{missing}".lstrip("."), "nothing", _meant(" and ".join(filter(None, words)) or "a value", meaning)
    meaning = error.schema.get("description", "")
    allowed = {
        "enum": lambda: " | ".join(map(str, value)),
        "type": lambda: _of_type(value, error.instance),
        "minLength": lambda: f"{value} or more characters",
        "maxLength": lambda: f"{value} or fewer characters",
        "minItems": lambda: _count(error.schema),
        "maxItems": lambda: _count(error.schema),
        "minProperties": lambda: f"{value} or more keys",
        "uniqueItems": lambda: "each entry once",
        "pattern": lambda: f"text that matches {value}",
        "format": lambda: f"a {value} such as {error.schema['examples'][0]}",
    }.get(rule, lambda: " and ".join(_bounds(error.schema)) if rule in _BOUNDS else error.message)()
    found = "nothing" if error.instance is None else repr(error.instance)
    return key, found, _meant(allowed, meaning)


def _meant(allowed: str, meaning: str) -> str:
    return f"{allowed} ({meaning})" if meaning else allowed


def _bounds(schema: Mapping[str, Any]) -> list[str]:
    """What a number may be: of two bounds on the same side the one that holds."""
    if "minimum" in schema and "maximum" in schema:
        return [f"{_number(schema['minimum'])} to {_number(schema['maximum'])}"]
    inner = {"exclusiveMinimum": "minimum", "exclusiveMaximum": "maximum"}
    return [
        words.format(_number(schema[name]))
        for name, words in _BOUNDS.items()
        if name in schema and inner.get(name) not in schema
    ]


def _number(value: float) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _count(schema: Mapping[str, Any]) -> str:
    least, most = schema.get("minItems", 0), schema.get("maxItems")
    if least == most:
        return f"{least} entries"
    return f"{least} or more entries" if most is None else f"{least} to {most} entries"


def _of_type(allowed: str | list[str], instance: Any) -> str:
    """What of a type is allowed, with the way to write a number that YAML takes for a text."""
    written = _WITHOUT_POINT.fullmatch(instance) if isinstance(instance, str) else None
    if written and ("number" in allowed):
        return f"number, which YAML has as {written[1]}.{written[2] or 0}e{written[3] or '+'}{written[4]}"
    words = {"number": "a finite number", "object": "keys with values, such as name: value", "null": "nothing"}
    return " or ".join(words.get(name, name) for name in ([allowed] if isinstance(allowed, str) else allowed))


def document_path(folder: str | Path, kind: str, name: str) -> str:
    """Where a document stands that a configuration names: ``folder/kind/name.yaml``."""
    return (Path(folder) / kind / f"{name}.yaml").as_posix()


def named_document(folder: str | Path, kind: str, schema: str, name: str, source: str) -> dict[str, Any]:
    """Read and check a document that a configuration, `source`, names: that of `name` without its ending in ``folder/kind``."""
    path = Path(document_path(folder, kind, name))
    known = sorted(file.stem for file in Path(folder, kind).glob("*.yaml") if file.is_file())
    # By its name alone: a path would lead out of the folder.
    if name not in known:
        allowed = f"a file of {Path(folder, kind).as_posix()}: {closest_first(name, known)}"
        raise InputError(source, kind, repr(name), allowed)
    document = read_document(path)
    check_document(document, schema, path.as_posix())
    return document
