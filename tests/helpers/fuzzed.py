"""Strategies of hypothesis for damaged files, and the check that a reader either reads
a file or refuses it in one short line."""

import copy

import yaml
from durations import at_once
from hypothesis import strategies as st

from elastocal.errors import LONGEST_MESSAGE, InputError

# Values in files of people and of attackers, some of them beyond the range of floats
# or integers.
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**20), 10**20),
    st.floats(),
    st.text(max_size=20),
    st.sampled_from(
        [
            "",
            "kuka",
            "../x",
            "/etc/passwd",
            "a\0b",
            "\x1b[2J",
            "x" * 300,
            "6e-5",
            "1_0",
            "unknown",
            "EE",
            "Rz(q1)",
        ]
    ),
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(SCALARS, inner, max_size=4)
    ),
    max_leaves=8,
)
# Pieces of YAML syntax; a random text rarely contains two of them.
PIECES = ["&a ", "*a", "!!python/object:os.system ", "<<: ", "? ", "- ", "\n", "\n  "]
PIECES += [*"{[}]\"'#|", ": ", "\t", "%", "---\n", "\0"]
BYTES = st.one_of(
    st.binary(max_size=200),
    st.lists(st.sampled_from(PIECES) | st.text(max_size=4), max_size=40)
    .map("".join)
    .map(lambda text: text.encode("utf-8", "surrogatepass")),
)


def iterate_paths(document, path=()):
    """Iterate over the paths of all values in a document, each a tuple of keys and
    indices."""
    yield path
    children = ()
    if isinstance(document, dict):
        children = document.items()
    elif isinstance(document, list):
        children = enumerate(document)
    for key, value in children:
        yield from iterate_paths(value, (*path, key))


@st.composite
def altered(draw, document):
    """Draw a valid document with one to three values replaced, deleted, renamed or
    enlarged."""
    document = copy.deepcopy(document)
    for _ in range(draw(st.integers(1, 3))):
        paths = [path for path in iterate_paths(document) if path]
        *parents, last = draw(st.sampled_from(paths or [("x",)]))
        inner = document
        for key in parents:
            inner = inner[key]
        change = draw(st.sampled_from(["replace", "delete", "rename", "enlarge"]))
        if change == "replace" or not document:
            inner[last] = draw(VALUES)
        elif change == "delete":
            del inner[last]
        elif change == "rename" and isinstance(inner, dict):
            inner[draw(SCALARS)] = inner.pop(last)
        elif isinstance(inner[last], list):
            inner[last] = inner[last] * draw(st.integers(0, 4))
        elif isinstance(inner[last], int | float):
            inner[last] = inner[last] * draw(
                st.sampled_from([-1, 0, 1e-300, 1e300, 10**6, 0.5])
            )
    return document


@st.composite
def damaged(draw, content):
    """Draw the bytes of a valid file, with some of them overwritten, removed or
    inserted."""
    content = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(content)))
        end = min(len(content), begin + draw(st.sampled_from([0, 1, 1, 4, 50])))
        content[begin:end] = draw(BYTES)
    return bytes(content)


def encode_document(document):
    """Return a document as the bytes of a YAML file."""
    return yaml.dump(document, sort_keys=False, allow_unicode=True).encode(
        "utf-8", "surrogatepass"
    )


def any_document(document):
    """Return a strategy for files that hold an altered document, a damaged one, or
    anything."""
    return st.one_of(
        BYTES,
        altered(document).map(encode_document),
        damaged(encode_document(document)),
    )


def assert_read_or_refused(read):
    """Call a reader, and check that it soon returns a value or raises one short line
    that can be printed."""
    with at_once():
        try:
            read()
        except InputError as error:
            message = str(error)
            assert len(message) <= LONGEST_MESSAGE, message
            assert message.isprintable(), message
            assert "; allowed: " in message, message
            message.encode("utf-8")


def assert_read_or_refused_from(path, content, read):
    """Check a reader while a file holds other bytes, and restore the file."""
    before = path.read_bytes()
    try:
        path.write_bytes(content)
        assert_read_or_refused(read)
    finally:
        path.write_bytes(before)


CELLS = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.text(max_size=8),
    st.sampled_from(["", "1_0", '"', "1,5", "#", "\n", "A", "é", "\0", "1" * 400]),
)


@st.composite
def tables(draw, content, separator=",", cells=CELLS):
    """Draw the bytes of a CSV file with cells, lines or columns changed."""
    lines = [line.split(separator) for line in content.decode().splitlines()]
    for _ in range(draw(st.integers(1, 3))):
        row = draw(st.integers(0, len(lines) - 1))
        change = draw(
            st.sampled_from(["cell", "cell", "cell", "row", "twice", "column"])
        )
        column = draw(st.integers(0, max(0, len(lines[row]) - 1)))
        if change == "cell" and lines[row]:
            lines[row][column] = draw(cells)
        elif change == "row":
            lines[row] = draw(st.lists(cells, max_size=30))
        elif change == "twice":
            lines.insert(draw(st.integers(0, len(lines))), list(lines[row]))
        else:
            for line in lines:
                del line[column : column + 1]
    return "\n".join(separator.join(line) for line in lines).encode(
        "utf-8", "surrogatepass"
    )
