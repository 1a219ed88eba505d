"""Whatever bytes a file holds, its reader gives a value or an InputError of one short line, in bounded time, and no more."""

import copy
import json
import time

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from made_cells import ARM, DOCUMENT, Cell
from study_folder import REPOSITORY

from elastocal.campaigns.reading import campaign_files, read_campaign, read_robot
from elastocal.campaigns.sources import campaign_sources
from elastocal.errors import LONGEST_MESSAGE, InputError
from elastocal.io.documents import check_document, read_document
from elastocal.mechanics.chain import parse_chain
from elastocal.study.configuration import check_study, with_overrides
from elastocal.study.strategies import check_strategy, strategy_from_document

LONGEST_S = 5.0
CONFIG = REPOSITORY / "config"
STUDY = yaml.safe_load((REPOSITORY / "config.yaml").read_text(encoding="utf-8"))
STRATEGY = yaml.safe_load((CONFIG / "strategies/3-6DoF-after-2DoF.yaml").read_text(encoding="utf-8"))
KUKA = yaml.safe_load((CONFIG / "robots/kuka_extended.yaml").read_text(encoding="utf-8"))
FULL = DOCUMENT | {
    "compliance": "identify",
    "noise": {"position_m": 6e-5, "joint_rad": [1e-5, 2e-5, 1e-5]},
    "holdout": {"poses": [1, 2, [0, 3]]},
    "serial_number": "7",
    "measured_on": "2026-11-20",
}

# What stands in files of people and of those who mean harm; beyond floats and beyond integers too.
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**20), 10**20),
    st.floats(),
    st.text(max_size=20),
    st.sampled_from(
        ["", "kuka", "../x", "/etc/passwd", "a\0b", "\x1b[2J", "x" * 300, "6e-5", "1_0", "unknown", "EE", "Rz(q1)"]
    ),
)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(SCALARS, inner, max_size=4), max_leaves=8
)
# Pieces of YAML of which a random text rarely holds two.
PIECES = [
    "&a ",
    "*a",
    "!!python/object:os.system ",
    "<<: ",
    "? ",
    "- ",
    "\n",
    "\n  ",
    "{",
    "[",
    "}",
    "]",
    '"',
    "'",
    "#",
    "|",
    ": ",
    "\t",
    "%",
    "---\n",
    "\0",
]
BYTES = st.one_of(
    st.binary(max_size=200),
    st.lists(st.sampled_from(PIECES) | st.text(max_size=4), max_size=40)
    .map("".join)
    .map(lambda text: text.encode("utf-8", "surrogatepass")),
)


def paths_of(document, at=()):
    """Ways to every value inside of a document."""
    yield at
    inner = document.items() if isinstance(document, dict) else enumerate(document) if isinstance(document, list) else ()
    for key, value in inner:
        yield from paths_of(value, (*at, key))


@st.composite
def altered(draw, document):
    """A valid document with one to three values replaced, taken away, added or renamed."""
    document = copy.deepcopy(document)
    for _ in range(draw(st.integers(1, 3))):
        *way, last = draw(st.sampled_from([path for path in paths_of(document) if path] or [("x",)]))
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
            inner[last] = inner[last] * draw(st.sampled_from([-1, 0, 1e-300, 1e300, 10**6, 0.5]))
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
    return yaml.dump(document, sort_keys=False, allow_unicode=True).encode("utf-8", "surrogatepass")


def any_document(document):
    """Files that hold a document, an altered one, a damaged one, or anything."""
    return st.one_of(BYTES, altered(document).map(written), damaged(written(document)))


def holds(read):
    """Call a reader: a value, or one short line that can be printed, soon."""
    begin = time.monotonic()
    try:
        read()
    except InputError as error:
        line = str(error)
        assert len(line) <= LONGEST_MESSAGE and line.isprintable() and "; allowed: " in line, line
        line.encode("utf-8")
    assert time.monotonic() - begin < LONGEST_S


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A valid campaign in a folder, robots beside it; each test writes one file of its own over it and takes it back."""
    cell = Cell(tmp_path_factory.mktemp("fuzz"))
    cell.document = FULL
    cell.write()
    return cell


def over(path, content, read):
    """Call a reader while a file holds other bytes."""
    before = path.read_bytes()
    try:
        path.write_bytes(content)
        holds(read)
    finally:
        path.write_bytes(before)


@given(any_document(FULL))
def test_descriptions_of_campaigns(place, content):
    over(place.folder / "campaign.yaml", content, lambda: read_campaign(place.folder, place.robots, ["joint_offset"]))
    over(place.folder / "campaign.yaml", content, lambda: campaign_files(place.folder, place.robots))


@given(any_document(ARM))
def test_robots_of_campaigns(place, content):
    over(place.folder / "arm.yaml", content, lambda: read_campaign(place.folder, place.robots))


@given(any_document(KUKA))
def test_robots_with_links(place, content):
    over(place.folder / "arm.yaml", content, lambda: read_robot(place.folder / "arm.yaml"))


@given(
    st.lists(
        st.sampled_from([*"TR", *"xyz", "(", ")", "q1", "q2", "-", "90deg", "l", "0.5", " ", "[E]", "1e999", "pas"]),
        max_size=30,
    ).map("".join)
    | st.text(max_size=30)
)
def test_chains(text):
    holds(lambda: parse_chain(text, {"l": 0.5}, "arm.yaml"))


@given(any_document(STRATEGY))
def test_strategies(place, kuka, content):
    path = place.folder / "strategy.yaml"
    path.touch()

    def read():
        document = read_document(path)
        check_document(document, "strategy", "strategy.yaml")
        check_strategy(strategy_from_document(document), kuka.chain, "strategy.yaml")

    over(path, content, read)


@given(any_document(STUDY))
def test_configurations(place, content):
    path = place.folder / "config.yaml"
    path.touch()

    def read():
        config = read_document(path)
        check_study(config, CONFIG, "config.yaml")
        campaign_sources(config, CONFIG, "config.yaml")

    over(path, content, read)


@given(
    st.sampled_from(sorted(STUDY)),
    SCALARS.map(str) | VALUES.map(lambda value: json.dumps(value, default=str)) | st.text(max_size=30),
)
def test_changes_on_the_command_line(key, text):
    holds(lambda: check_study(with_overrides(STUDY, [f"{key}={text}"]), CONFIG, "config.yaml"))


CELLS = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.text(max_size=8),
    st.sampled_from(["", "1_0", '"', "1,5", "#", "\n", "A", "é", "\0", "1" * 400]),
)


@st.composite
def tables(draw, content):
    """Bytes of a CSV file with cells, lines or columns changed."""
    lines = [line.split(",") for line in content.decode().splitlines()]
    for _ in range(draw(st.integers(1, 3))):
        row = draw(st.integers(0, len(lines) - 1))
        change = draw(st.sampled_from(["cell", "cell", "cell", "row", "twice", "column"]))
        column = draw(st.integers(0, max(0, len(lines[row]) - 1)))
        if change == "cell" and lines[row]:
            lines[row][column] = draw(CELLS)
        elif change == "row":
            lines[row] = draw(st.lists(CELLS, max_size=30))
        elif change == "twice":
            lines.insert(draw(st.integers(0, len(lines))), list(lines[row]))
        else:
            for line in lines:
                del line[column : column + 1]
    return "\n".join(",".join(line) for line in lines).encode("utf-8", "surrogatepass")


@given(st.data())
def test_measurements_as_text(place, data):
    path = place.folder / "measurements.csv"
    content = path.read_bytes()
    drawn = data.draw(st.one_of(BYTES, damaged(content), tables(content)))
    over(path, drawn, lambda: read_campaign(place.folder, place.robots))


ARRAYS = st.sampled_from(
    [
        lambda n: pa.nulls(n),
        lambda n: pa.array([True] * n),
        lambda n: pa.array([b"\xff"] * n),
        lambda n: pa.array([[1.0]] * n),
        lambda n: pa.array([{"a": 1}] * n),
        lambda n: pa.array(["A"] * n),
        lambda n: pa.array(["A"] * n).dictionary_encode(),
        lambda n: pa.array([2**63] * n, pa.uint64()),
        lambda n: pa.array([float("nan")] * n),
        lambda n: pa.array([1e300] * n),
        lambda n: pa.array([0] * n, pa.timestamp("us")),
        lambda n: pa.array([None, *[1.0] * (n - 1)]),
        lambda n: pa.array(["\ud7ff" * 50] * n),
        lambda n: pa.array([1] * n, pa.decimal128(20, 2)),
        lambda n: pa.array([1.0] * n, pa.float16()),
    ]
)


@pytest.fixture(scope="module")
def parquet(tmp_path_factory):
    cell = Cell(tmp_path_factory.mktemp("parquet"))
    cell.write("parquet")
    return cell


@given(st.data())
def test_measurements_as_parquet(parquet, data):
    path = parquet.folder / "measurements.parquet"
    content, table = path.read_bytes(), pa.table(parquet.table)
    if data.draw(st.booleans()):
        drawn = data.draw(damaged(content) | st.binary(max_size=100).map(lambda inner: b"PAR1" + inner + b"PAR1"))
    else:
        column = data.draw(st.integers(0, table.num_columns - 1))
        name = data.draw(st.sampled_from([table.column_names[column], "x", "target", "é\n", ""]))
        sink = pa.BufferOutputStream()
        try:
            pq.write_table(table.set_column(column, name, data.draw(ARRAYS)(len(table))), sink)
        except pa.ArrowException:
            return
        drawn = sink.getvalue().to_pybytes()
    over(path, drawn, lambda: read_campaign(parquet.folder, parquet.robots))
