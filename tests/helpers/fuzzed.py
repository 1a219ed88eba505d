"""Damaged files: what hypothesis draws them from, and what a reader has to do with
each."""

import copy

import yaml
from durations import at_once
from hypothesis import strategies as st

from elastocal.errors import LONGEST_MESSAGE, InputError

# What stands in files of people and of those who mean harm; beyond floats and beyond
# integers too.
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
# Pieces of YAML of which a random text rarely holds two.
PIECES = ["&a ", "*a", "!!python/object:os.system ", "<<: ", "? ", "- ", "\n", "\n  "]
PIECES += [*"{[}]\"'#|", ": ", "\t", "%", "---\n", "\0"]
BYTES = st.one_of(
    st.binary(max_size=200),
    st.lists(st.sampled_from(PIECES) | st.text(max_size=4), max_size=40)
    .map("".join)
    .map(lambda text: text.encode("utf-8", "surrogatepass")),
)


def paths_of(document, at=()):
    """Ways to every value inside of a document."""
    yield at
    inner = (
        document.items()
        if isinstance(document, dict)
        else enumerate(document)
        if isinstance(document, list)
        else ()
    )
    for key, value in inner:
        yield from paths_of(value, (*at, key))


@st.composite
def altered(draw, document):
    """A valid document with one to three values replaced, taken away, added or
    renamed."""
    document = copy.deepcopy(document)
    for _ in range(draw(st.integers(1, 3))):
        *way, last = draw(
            st.sampled_from([path for path in paths_of(document) if path] or [("x",)])
        )
        inner = document
        for key in way:
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
    """Bytes of a valid file, some of them overwritten, cut out or put in."""
    content = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(content)))
        end = min(len(content), begin + draw(st.sampled_from([0, 1, 1, 4, 50])))
        content[begin:end] = draw(BYTES)
    return bytes(content)


def written(document):
    return yaml.dump(document, sort_keys=False, allow_unicode=True).encode(
        "utf-8", "surrogatepass"
    )


def any_document(document):
    """Files that hold a document, an altered one, a damaged one, or anything."""
    return st.one_of(BYTES, altered(document).map(written), damaged(written(document)))


def holds(read):
    """Call a reader: a value, or one short line that can be printed, soon."""
    with at_once():
        try:
            read()
        except InputError as error:
            line = str(error)
            assert (
                len(line) <= LONGEST_MESSAGE
                and line.isprintable()
                and "; allowed: " in line
            ), line
            line.encode("utf-8")


def over(path, content, read):
    """Call a reader while a file holds other bytes."""
    before = path.read_bytes()
    try:
        path.write_bytes(content)
        holds(read)
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
    """Bytes of a CSV file with cells, lines or columns changed."""
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
