"""YAML documents that users write: read, and checked against a JSON schema that knows
every key."""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from itertools import islice
from pathlib import Path
from typing import Any, ClassVar

import yaml

from elastocal.errors import InputError, find_text_fault, suggest_name, suggest_names
from elastocal.io.texts import read_text

# Far above what people write by hand (no schema goes deeper than 7), and read in
# seconds whatever it holds.
LARGEST_BYTES = 300_000
MOST_VALUES = 100_000
DEEPEST = 20
# More digits are no number that anything here counts, and beyond 308 no floating-point
# number.
_MOST_DIGITS = 18
_DECIMAL = re.compile(
    rf"[-+]?(0|[1-9]\d{{0,{_MOST_DIGITS - 1}}})|[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)|[-+]?(\d+\.\d*|\.\d+)|[-+]?\.(inf|nan)",
    re.ASCII | re.IGNORECASE,
)
# Faults of one document that are looked at: it may hold a fault in each of its entries.
_MOST_FAULTS = 1000
_NOT_XML = "YAML; a URDF becomes a robot file by `elastocal import urdf FILE --base LINK --tip LINK --output robot.yaml`"


class _UnclearError(yaml.MarkedYAMLError):
    """What people and YAML 1.1 read differently; `allowed` is what may stand there."""

    def __init__(self, mark: Any, found: str, allowed: str) -> None:
        super().__init__(problem=found, problem_mark=mark)
        self.allowed = allowed


# The safe loader, in C where libyaml is there: the study is read at every call of
# snakemake.
class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Safe; a date stays the text that it is in the file, each key stands once, and
    numbers are decimal."""

    yaml_implicit_resolvers: ClassVar = {
        first: [
            (tag, pattern)
            for tag, pattern in resolvers
            if tag != "tag:yaml.org,2002:timestamp"
        ]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def construct_mapping(
        self, node: yaml.MappingNode, deep: bool = False
    ) -> dict[Any, Any]:
        """A mapping; of keys that stand there twice the last would win."""
        first: dict[str, yaml.Node] = {}
        for key, _ in node.value:
            if (
                isinstance(key, yaml.ScalarNode)
                and first.setdefault(key.value, key) is not key
            ):
                line = first[key.value].start_mark.line + 1
                raise _UnclearError(
                    key.start_mark,
                    f"the key {key.value!r} again",
                    f"each key once (first in line {line})",
                )
        mapping: dict[Any, Any] = super().construct_mapping(node, deep)
        return mapping

    def construct_number(self, node: yaml.ScalarNode) -> int | float:
        """A decimal number; YAML 1.1 would read 1_0 as 10, 010 as 8 and 1:30 as 90."""
        if not _DECIMAL.fullmatch(node.value):
            allowed = f"a decimal number of at most {_MOST_DIGITS} digits, or in quotes what is a text"
            raise _UnclearError(node.start_mark, node.value, allowed)
        number: int | float = (
            self.construct_yaml_float(node)
            if node.tag.endswith("float")
            else int(node.value)
        )
        return number


for _kind in ("int", "float"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _Loader.construct_number)
# A number without a point or a sign in its exponent, which YAML 1.1 takes for a text.
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+$", re.ASCII),
    "-+0123456789",
)


@cache
def _validator(schema: str) -> Any:
    """Stricter than JSON, which has no NaN and no infinity and takes 10.0 for an
    integer."""
    import jsonschema

    def each_once(_: Any, wanted: bool, instance: Any, __: Any) -> Iterator[Exception]:
        """The rule uniqueItems in linear time: jsonschema compares each pair where
        numbers and lists are mixed."""
        if wanted and isinstance(instance, list):
            entries = [json.dumps(entry, default=str) for entry in instance]
            if len(set(entries)) < len(entries):
                yield jsonschema.ValidationError("an entry twice")

    types = {
        "integer": lambda _, value: (
            isinstance(value, int) and not isinstance(value, bool)
        ),
        "number": lambda _, value: (
            isinstance(value, int | float)
            and not isinstance(value, bool)
            and math.isfinite(value)
        ),
    }
    base = jsonschema.Draft202012Validator
    checked = base.TYPE_CHECKER.redefine_many(types)
    validator = jsonschema.validators.extend(
        base, {"uniqueItems": each_once}, type_checker=checked
    )
    return validator(
        read_schema(schema), format_checker=jsonschema.FormatChecker(["date"])
    )


def read_document(path: str | Path) -> Any:
    """Contents of a YAML file; one that is missing or `parse_yaml` refuses is an
    InputError."""
    return parse_yaml(read_text(path, LARGEST_BYTES), path)


def parse_yaml(text: str, source: str | Path) -> Any:
    """Contents of a YAML text; an InputError names the line of what is no YAML, unclear
    or out of bounds, such as a URDF."""
    if text.lstrip("\ufeff \r\n\t").startswith("<"):
        raise InputError(source, "", "XML", _NOT_XML)
    try:
        _check_events(text)
        return yaml.load(text, Loader=_Loader)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        found = f"the control character {chr(error.character)!r}"
        raise InputError(source, f"line {line}", found, "YAML") from None
    except yaml.MarkedYAMLError as error:
        mark: Any = error.problem_mark or error.context_mark
        found = str(error.problem)
        if not isinstance(error, _UnclearError):
            here = "".join(text.splitlines()[mark.line :][:1])[mark.column :][
                :40
            ].strip()
            problem, _, wanted = found.partition("did not find expected ")
            found = f"{f'no {wanted}' if wanted else problem.removeprefix('found ')}: {here!r}"
        raise InputError(
            source, f"line {mark.line + 1}", found, getattr(error, "allowed", "YAML")
        ) from None


def _check_events(text: str) -> None:
    """Refuse what lets a small file grow beyond bounds or makes other objects than
    values, before anything is made of it.

    An alias counts as all values before it, more than its anchor has; none may stand
    within an anchor, and so for others.
    """
    plain = 0
    total = 0
    opened = list[str | None]()
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent):
            if event.tag is not None:
                raise _UnclearError(
                    event.start_mark, f"the tag {event.tag}", "values without tags"
                )
            plain = plain + 1
            total = total + 1
        if isinstance(event, yaml.AliasEvent):
            if any(opened):
                raise _UnclearError(
                    event.start_mark,
                    f"the alias *{event.anchor}",
                    "one in no other anchor",
                )
            total += plain
        if isinstance(event, yaml.CollectionStartEvent):
            opened.append(event.anchor)
        elif isinstance(event, yaml.CollectionEndEvent):
            opened.pop()
        if len(opened) >= DEEPEST:
            raise _UnclearError(
                event.start_mark,
                "lists or keys in each other",
                f"at most {DEEPEST} deep",
            )
        if total > MOST_VALUES:
            raise _UnclearError(
                event.start_mark,
                "more values than a document has",
                f"at most {MOST_VALUES} with aliases",
            )


def format_one_line(value: Any) -> str:
    """A value as YAML on one line."""
    text: str = yaml.safe_dump(
        value,
        default_flow_style=True,
        width=math.inf,
        sort_keys=False,
        allow_unicode=True,
    )
    return text.removesuffix("\n").removesuffix("\n...")


@cache
def read_schema(name: str) -> dict[str, Any]:
    """One of the package's schemas: ``config``, ``robot`` or ``strategy``."""
    text = (
        resources.files("elastocal")
        .joinpath("schemas", f"{name}.yaml")
        .read_text(encoding="utf-8")
    )
    return yaml.load(text, Loader=_Loader)


def check_document(document: Any, schema: str, source: str) -> None:
    """Check a document of the file `source` against a schema, as `read_schema` names
    it; the first key at fault is refused."""
    errors = islice(_validator(schema).iter_errors(document), _MOST_FAULTS)
    if error := min(
        errors,
        key=lambda error: [str(part) for part in error.absolute_path],
        default=None,
    ):
        raise _refusal(source, *_explained(error))
    for place, text in _texts(document):
        # White space between the transforms of a chain is free.
        if fault := find_text_fault(
            " ".join(text.split()) if place == ("chain",) else text
        ):
            raise _refusal(source, place, *fault)


def _refusal(
    source: str, path: Sequence[str | int], found: str, allowed: str
) -> InputError:
    """An error at a key, with its line where the file has it."""
    key = "".join(
        f"[{part}]" if isinstance(part, int) else f".{part}" for part in path
    ).lstrip(".")
    return InputError(
        source, ", ".join(filter(None, (_line_of(source, path), key))), found, allowed
    )


def _texts(
    value: Any, path: tuple[str | int, ...] = ()
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """All texts of a document, keys among them, and where each stands."""
    if isinstance(value, str):
        yield path, value
    for key, each in (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    ):
        if isinstance(key, str):
            yield (*path, key), key
        yield from _texts(each, (*path, key))


def _line_of(source: str, path: Sequence[str | int]) -> str:
    """Line of the file at which a key stands, or what it should stand in; empty where
    the file has neither."""
    try:
        node = yaml.compose(read_text(source, LARGEST_BYTES), Loader=_Loader)
    except (InputError, yaml.YAMLError):
        return ""
    line = ""
    for part in path:
        if (
            isinstance(node, yaml.SequenceNode)
            and isinstance(part, int)
            and part < len(node.value)
        ):
            place = node = node.value[part]
        else:
            entries = node.value if isinstance(node, yaml.MappingNode) else []
            place, node = next(
                ((key, value) for key, value in entries if key.value == str(part)),
                (None, None),
            )
        if place is None:
            break
        line = f"line {place.start_mark.line + 1}"
    return line


def _explained(error: Any) -> tuple[list[str | int], str, str]:
    """Where one violation is, what was found there and what is allowed."""
    path = [*error.absolute_path]
    schema = error.schema
    if error.validator == "additionalProperties":
        known = sorted(schema.get("properties", {}))
        unknown = next(name for name in error.instance if name not in known)
        return (
            [*path, unknown],
            "an unknown key",
            f"{suggest_name(unknown, known)} ({', '.join(known)})".strip(),
        )
    if error.validator == "required":
        missing = next(
            name for name in error.validator_value if name not in error.instance
        )
        return [*path, missing], "nothing", _admitted(schema["properties"][missing])
    return (
        path,
        "nothing" if error.instance is None else repr(error.instance),
        _admitted(schema) or error.message,
    )


_KINDS = {
    "number": "a finite number",
    "object": "keys with values, such as name: value",
    "null": "nothing",
}
_RANGES = (
    ("minimum", "maximum", ""),
    ("minLength", "maxLength", " characters"),
    ("minItems", "maxItems", " entries"),
)
_OTHERS = {
    "exclusiveMinimum": "more than {}",
    "exclusiveMaximum": "less than {}",
    "minProperties": "{} or more keys",
    "pattern": "text that matches {}",
    "format": "a {} such as 2026-11-20",
    "uniqueItems": "each entry once",
}


def _admitted(schema: Mapping[str, Any]) -> str:
    """What a schema admits, in words, with what it means in brackets."""
    kinds = (
        [schema["type"]]
        if isinstance(schema.get("type"), str)
        else schema.get("type", [])
    )
    kind = " or ".join(_KINDS.get(each, each) for each in kinds)
    parts = [
        " | ".join(map(str, schema["enum"]))
        if "enum" in schema
        else ""
        if "minItems" in schema
        else kind
    ]
    for low, high, unit in _RANGES:
        least = schema.get(low)
        most = schema.get(high)
        if least is not None and most is not None:
            parts.append(
                f"{least}{unit}" if least == most else f"{least} to {most}{unit}"
            )
        elif least is not None or most is not None:
            parts.append(
                f"{least} or more{unit}" if most is None else f"{most} or fewer{unit}"
            )
    parts += [
        words.format(schema[rule]) for rule, words in _OTHERS.items() if rule in schema
    ]
    return ", ".join(filter(None, parts)) + (
        f" ({schema['description']})" if "description" in schema else ""
    )


def document_path(folder: str | Path, kind: str, name: str) -> str:
    """Where a document stands that a configuration names: ``folder/kind/name.yaml``."""
    return (Path(folder) / kind / f"{name}.yaml").as_posix()


def read_named_document(
    folder: str | Path, kind: str, schema: str, name: str, source: str
) -> dict[str, Any]:
    """Read and check a document that a configuration, `source`, names: that of `name`
    without its ending in ``folder/kind``."""
    known = sorted(
        file.stem for file in Path(folder, kind).glob("*.yaml") if file.is_file()
    )
    # By its name alone: a path would lead out of the folder.
    if name not in known:
        allowed = (
            f"a file of {Path(folder, kind).as_posix()}: {suggest_names(name, known)}"
        )
        raise InputError(source, kind, repr(name), allowed)
    path = document_path(folder, kind, name)
    document = read_document(path)
    check_document(document, schema, path)
    return document
