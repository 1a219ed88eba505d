"""Read YAML documents that users write, and check them against a JSON schema that knows
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

# Contents of a document by its keys.
Document = Mapping[str, Any]
# Upper bounds on a document. They are far above what people write by hand (no schema is
# deeper than 7), and a document within them is read in seconds whatever it holds.
LARGEST_BYTES = 300_000
MOST_VALUES = 100_000
DEEPEST = 20
# Upper bound on the digits of an integer. No document counts that far, and an integer of
# more than 308 digits cannot be converted to a floating-point number.
_MOST_DIGITS = 18
_DECIMAL = re.compile(
    rf"[-+]?(0|[1-9]\d{{0,{_MOST_DIGITS - 1}}})"
    r"|[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)"
    r"|[-+]?(\d+\.\d*|\.\d+)"
    r"|[-+]?\.(inf|nan)",
    re.ASCII | re.IGNORECASE,
)
# Upper bound on the faults of a document that are compared to find the first one.
_MOST_FAULTS = 1000
_NOT_XML = (
    "YAML; a URDF becomes a robot file by `elastocal import urdf FILE --base LINK "
    "--tip LINK --output robot.yaml`"
)


class _UnclearError(yaml.MarkedYAMLError):
    """A text that people and YAML 1.1 read differently; `allowed` is allowed instead."""

    def __init__(self, mark: Any, finding: str, allowed: str) -> None:
        super().__init__(problem=finding, problem_mark=mark)
        self.line = mark.line + 1
        self.allowed = allowed


def _drop_dates(rules: list[tuple[str, Any]]) -> list[tuple[str, Any]]:
    """Return implicit types of YAML, pairs of tag and pattern, without the date."""
    return [rule for rule in rules if rule[0] != "tag:yaml.org,2002:timestamp"]


# Use the safe loader in C if libyaml is installed, because every start of Snakemake reads
# the configuration of the study.
class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Safe loader for which a date is a text, each key occurs once, and numbers are
    decimal."""

    yaml_implicit_resolvers: ClassVar = {
        first: _drop_dates(rules)
        for first, rules in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def construct_mapping(
        self, node: yaml.MappingNode, *, deep: bool = False
    ) -> dict[Any, Any]:
        """Return a mapping; refuse a repeated key, of which YAML takes the last."""
        first_nodes: dict[str, yaml.Node] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            first = first_nodes.setdefault(key.value, key)
            if first is not key:
                finding = f"the key {key.value!r} again"
                allowed = f"each key once (first in line {first.start_mark.line + 1})"
                raise _UnclearError(key.start_mark, finding, allowed)
        mapping: dict[Any, Any] = super().construct_mapping(node, deep)
        return mapping

    def construct_number(self, node: yaml.ScalarNode) -> int | float:
        """Return a decimal number; YAML 1.1 reads 1_0 as 10, 010 as 8 and 1:30 as 90."""
        if not _DECIMAL.fullmatch(node.value):
            allowed = f"a decimal number of at most {_MOST_DIGITS} digits, or a text in quotes"
            raise _UnclearError(node.start_mark, node.value, allowed)
        number: int | float = (
            self.construct_yaml_float(node)
            if node.tag.endswith("float")
            else int(node.value)
        )
        return number


for _kind in ("int", "float"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _Loader.construct_number)
# Read 1e5, which has neither a point nor a sign in its exponent, as a number. YAML 1.1
# reads it as a text.
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+$", re.ASCII),
    "-+0123456789",
)


@cache
def _validator(schema: str) -> Any:
    """Return the validator of a schema. It refuses NaN and infinity, and 10.0 for an
    integer."""
    import jsonschema

    def find_repeated_entry(
        _: Any, wanted: Any, instance: Any, __: Any
    ) -> Iterator[Exception]:
        """Check uniqueItems in linear time: jsonschema compares each pair of entries if
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
        base, {"uniqueItems": find_repeated_entry}, type_checker=checked
    )
    return validator(
        read_schema(schema), format_checker=jsonschema.FormatChecker(["date"])
    )


def read_document(path: str | Path) -> Any:
    """Read a YAML file; an InputError refuses a missing file, or as `parse_yaml`."""
    return parse_yaml(read_text(path, LARGEST_BYTES), path)


def parse_yaml(text: str, source: str | Path) -> Any:
    """Return the contents of a YAML text.

    Parameters
    ----------
    text : YAML.
    source : file, for messages.

    Raises
    ------
    InputError
        If the text is not YAML, unclear, or out of bounds; with its line.
    """
    if text.lstrip("\ufeff \r\n\t").startswith("<"):
        raise InputError(source, "", "XML", _NOT_XML)
    try:
        _check_events(text)
        return yaml.load(text, Loader=_Loader)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        finding = f"the control character {chr(error.character)!r}"
        raise InputError(source, f"line {line}", finding, "YAML") from None
    except _UnclearError as error:
        finding = str(error.problem)
        raise InputError(source, f"line {error.line}", finding, error.allowed) from None
    except yaml.MarkedYAMLError as error:
        mark: Any = error.problem_mark or error.context_mark
        finding = _describe_yaml_error(str(error.problem), text, mark)
        raise InputError(source, f"line {mark.line + 1}", finding, "YAML") from None


def _describe_yaml_error(problem: str, text: str, mark: Any) -> str:
    """Return an error of PyYAML for a message, with the text at its place."""
    rest_of_line = "".join(text.splitlines()[mark.line :][:1])[mark.column :]
    excerpt = rest_of_line[:40].strip()
    summary, _, expected = problem.partition("did not find expected ")
    if expected:
        return f"no {expected}: {excerpt!r}"
    return f"{summary.removeprefix('found ')}: {excerpt!r}"


def _check_events(text: str) -> None:
    """Refuse a small file that would grow out of bounds or make objects other than
    values, before it is loaded.

    An alias counts as all values before it, which are more than its anchor has. An
    alias within an anchor is refused, so that this holds.
    """
    value_count = 0
    # Also counts the values of aliases.
    expanded_count = 0
    anchors = list[str | None]()
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent):
            if event.tag is not None:
                finding = f"the tag {event.tag}"
                raise _UnclearError(event.start_mark, finding, "values without tags")
            value_count += 1
            expanded_count += 1
        if isinstance(event, yaml.AliasEvent):
            if any(anchors):
                finding = f"the alias *{event.anchor}"
                raise _UnclearError(event.start_mark, finding, "one in no other anchor")
            expanded_count += value_count
        if isinstance(event, yaml.CollectionStartEvent):
            anchors.append(event.anchor)
        elif isinstance(event, yaml.CollectionEndEvent):
            anchors.pop()
        if len(anchors) >= DEEPEST:
            finding = "lists or keys in each other"
            raise _UnclearError(event.start_mark, finding, f"at most {DEEPEST} deep")
        if expanded_count > MOST_VALUES:
            finding = "more values than a document has"
            allowed = f"at most {MOST_VALUES} with aliases"
            raise _UnclearError(event.start_mark, finding, allowed)


def format_one_line(value: Any) -> str:
    """Return a value as YAML on one line."""
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
    """Read a schema of the package, such as ``config``, ``robot`` or ``strategy``."""
    text = (
        resources.files("elastocal")
        .joinpath("schemas", f"{name}.yaml")
        .read_text(encoding="utf-8")
    )
    return yaml.load(text, Loader=_Loader)


def check_document(document: Any, schema: str, source: str) -> None:
    """Check a document against a schema; the first key at fault is refused.

    Parameters
    ----------
    document : contents of the document.
    schema : name of the schema, as in `read_schema`.
    source : file of the document, for messages.
    """
    errors = islice(_validator(schema).iter_errors(document), _MOST_FAULTS)
    error = min(
        errors,
        key=lambda error: [str(key) for key in error.absolute_path],
        default=None,
    )
    if error is not None:
        raise make_violation_error(source, error)
    for path, text in _iterate_texts(document):
        if path == ("chain",):
            # White space between the transforms of a chain may be a line break.
            text = " ".join(text.split())
        if fault := find_text_fault(text):
            raise _refusal(source, path, *fault)


def _refusal(
    source: str | Path, path: Sequence[str | int], finding: str, allowed: str
) -> InputError:
    """Return an error at a key, with its line if the file has it."""
    key = "".join(
        f"[{entry}]" if isinstance(entry, int) else f".{entry}" for entry in path
    ).lstrip(".")
    location = ", ".join(filter(None, (_find_line(source, path), key)))
    return InputError(source, location, finding, allowed)


def _iterate_texts(
    value: Any, path: tuple[str | int, ...] = ()
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Iterate over all texts of a document, including keys, with their paths."""
    if isinstance(value, str):
        yield path, value
    elif isinstance(value, dict):
        for key, entry in value.items():
            if isinstance(key, str):
                yield (*path, key), key
            yield from _iterate_texts(entry, (*path, key))
    elif isinstance(value, list):
        for index, entry in enumerate(value):
            yield from _iterate_texts(entry, (*path, index))


def _find_line(source: str | Path, path: Sequence[str | int]) -> str:
    """Return the line of the file at which a key is, or else the entry that should
    contain it; empty if the file has neither."""
    try:
        node = yaml.compose(read_text(source, LARGEST_BYTES), Loader=_Loader)
    except (InputError, yaml.YAMLError):
        return ""
    line = ""
    for entry in path:
        marked_node, node = _find_entry(node, entry)
        if marked_node is None:
            break
        line = f"line {marked_node.start_mark.line + 1}"
    return line


def _find_entry(node: Any, entry: str | int) -> tuple[Any, Any]:
    """Return the node at which an entry begins, and the node of its value; None if there
    is none."""
    if isinstance(node, yaml.SequenceNode) and isinstance(entry, int):
        if entry < len(node.value):
            return node.value[entry], node.value[entry]
    elif isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if key.value == str(entry):
                return key, value
    return None, None


def make_violation_error(source: str | Path, error: Any) -> InputError:
    """Return the error of a document that violates its schema, as jsonschema found."""
    path = [*error.absolute_path]
    schema = error.schema
    if error.validator == "additionalProperties":
        keys = sorted(schema.get("properties", {}))
        unknown = next(name for name in error.instance if name not in keys)
        allowed = f"{suggest_name(unknown, keys)} ({', '.join(keys)})".strip()
        return _refusal(source, [*path, unknown], "an unknown key", allowed)
    if error.validator == "required":
        missing = next(
            name for name in error.validator_value if name not in error.instance
        )
        allowed = _describe_schema(schema["properties"][missing])
        return _refusal(source, [*path, missing], "nothing", allowed or "a value")
    finding = "nothing" if error.instance is None else repr(error.instance)
    return _refusal(source, path, finding, _describe_schema(schema) or error.message)


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
_RULES = {
    "exclusiveMinimum": "more than {}",
    "exclusiveMaximum": "less than {}",
    "minProperties": "{} or more keys",
    "pattern": "text that matches {}",
    "format": "a {} such as 2026-11-20",
    "uniqueItems": "each entry once",
}


def _describe_schema(schema: Mapping[str, Any]) -> str:
    """Return in words what a schema allows, with its description in brackets."""
    phrases = [_describe_type(schema)]
    phrases += [_describe_range(schema, *names) for names in _RANGES]
    phrases += [
        phrase.format(schema[rule]) for rule, phrase in _RULES.items() if rule in schema
    ]
    text = ", ".join(filter(None, phrases))
    if "description" in schema:
        text += f" ({schema['description']})"
    return text


def _describe_type(schema: Mapping[str, Any]) -> str:
    if "enum" in schema:
        return " | ".join(map(str, schema["enum"]))
    if "minItems" in schema:
        return ""
    kinds = schema.get("type", [])
    if isinstance(kinds, str):
        kinds = [kinds]
    return " or ".join(_KINDS.get(kind, kind) for kind in kinds)


def _describe_range(
    schema: Mapping[str, Any], lower_name: str, upper_name: str, unit: str
) -> str:
    lower = schema.get(lower_name)
    upper = schema.get(upper_name)
    if lower is None and upper is None:
        return ""
    if upper is None:
        return f"{lower} or more{unit}"
    if lower is None:
        return f"{upper} or fewer{unit}"
    return f"{lower}{unit}" if lower == upper else f"{lower} to {upper}{unit}"


def locate_document(folder: str | Path, kind: str, name: str) -> str:
    """Return the path of a document that a configuration names:
    ``folder/kind/name.yaml``."""
    return (Path(folder) / kind / f"{name}.yaml").as_posix()


def read_named_document(
    folder: str | Path, kind: str, schema: str, name: str, source: str
) -> dict[str, Any]:
    """Read and check a document that a configuration names.

    Parameters
    ----------
    folder, kind : the document is in ``folder/kind``.
    schema : name of its schema.
    name : name of the file without its ending.
    source : file of the configuration, for messages.
    """
    files = Path(folder, kind).glob("*.yaml")
    names = sorted(file.stem for file in files if file.is_file())
    # Accept a name only, because a path might lead out of the folder.
    if name not in names:
        listed = suggest_names(name, names)
        allowed = f"a file of {Path(folder, kind).as_posix()}: {listed}"
        raise InputError(source, kind, repr(name), allowed)
    path = locate_document(folder, kind, name)
    document: dict[str, Any] = read_document(path)
    check_document(document, schema, path)
    return document
