"""For any bytes in a file, its reader returns a value or raises an InputError of one
short line, in bounded time."""

import json

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from fuzzed import (
    BYTES,
    SCALARS,
    VALUES,
    any_document,
    assert_read_or_refused,
    assert_read_or_refused_from,
    damaged,
    tables,
)
from hypothesis import given
from hypothesis import strategies as st
from made_cells import ARM, DOCUMENT, Cell
from study_folder import REPOSITORY

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.importers import read_campaign_sources
from elastocal.campaigns.reading import read_campaign, read_robot
from elastocal.io.documents import check_document, read_document
from elastocal.mechanics.chain import parse_chain
from elastocal.study.configuration import check_study, override_entries
from elastocal.study.strategies import check_strategy, strategy_from_document

CONFIG = REPOSITORY / "config"
STUDY, STRATEGY, KUKA = (
    yaml.safe_load((REPOSITORY / name).read_text(encoding="utf-8"))
    for name in (
        "config.yaml",
        "config/strategies/3-6DoF-after-2DoF.yaml",
        "config/robots/kuka_extended.yaml",
    )
)
FULL = DOCUMENT | {
    "compliance": "identify",
    "noise": {"position_m": 6e-5, "joint_rad": [1e-5, 2e-5, 1e-5]},
    "holdout": {"poses": [1, 2, [0, 3]]},
    "serial_number": "7",
    "measured_on": "2026-11-20",
}
PIECES = [
    *"TR",
    *"xyz",
    "(",
    ")",
    "q1",
    "q2",
    "-",
    "90deg",
    "l",
    "0.5",
    " ",
    "[E]",
    "1e999",
    "pas",
]


def read_strategy(path):
    document = read_document(path)
    check_document(document, "strategy", path)
    check_strategy(
        strategy_from_document(document),
        read_robot(CONFIG / "robots/kuka.yaml").chain,
        path,
    )


def read_study(path):
    config = read_document(path)
    check_study(config, CONFIG, path)
    read_campaign_sources(config, CONFIG, path)


# Of each kind of file: its valid document, its name and its reader.
READERS = {
    "campaign": (
        FULL,
        "campaign.yaml",
        lambda path: read_campaign(
            read_campaign_folder(path.parent, path.parents[1] / "robots"),
            ["joint_offset"],
        ),
    ),
    "files of a campaign": (
        FULL,
        "campaign.yaml",
        lambda path: read_campaign_folder(
            path.parent, path.parents[1] / "robots"
        ).files(),
    ),
    "robot": (
        ARM,
        "arm.yaml",
        lambda path: read_campaign(
            read_campaign_folder(path.parent, path.parents[1] / "robots")
        ),
    ),
    "robot with links": (KUKA, "arm.yaml", read_robot),
    "strategy": (STRATEGY, "strategy.yaml", read_strategy),
    "configuration": (STUDY, "config.yaml", read_study),
}
# Values that are no numbers, or no numbers of measurements; a column repeats them.
ODD_COLUMNS = [
    pa.array([value])
    for value in (None, True, b"\xff", [1.0], {"a": 1}, float("nan"), "\ud7ff" * 50)
]
ODD_COLUMNS += [
    pa.array(["A"]).dictionary_encode(),
    pa.array([None, 1.0]),
    pa.array([2**63], pa.uint64()),
]
ODD_COLUMNS += [
    pa.array([1], kind) for kind in (pa.timestamp("us"), pa.decimal128(20, 2))
]
ARRAYS = st.sampled_from(ODD_COLUMNS)


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """A valid campaign in a folder, next to its robots. Each test overwrites one file
    and restores it."""
    cell = Cell(tmp_path_factory.mktemp("fuzz"))
    cell.document = FULL
    cell.write()
    return cell


@pytest.mark.parametrize("kind", READERS)
@given(st.data())
def test_a_document_is_read_or_refused(cell, kind, data):
    document, name, read = READERS[kind]
    path = cell.folder / name
    path.touch()
    content = data.draw(any_document(document))
    assert_read_or_refused_from(path, content, lambda: read(path))


@given(
    st.lists(st.sampled_from(PIECES), max_size=30).map("".join) | st.text(max_size=30)
)
def test_a_kinematic_chain_is_parsed_or_refused(text):
    assert_read_or_refused(lambda: parse_chain(text, {"l": 0.5}, "arm.yaml"))


@given(
    st.sampled_from(sorted(STUDY)),
    SCALARS.map(str)
    | VALUES.map(lambda value: json.dumps(value, default=str))
    | st.text(max_size=30),
)
def test_a_changed_entry_on_the_command_line_is_accepted_or_refused(key, text):
    assert_read_or_refused(
        lambda: check_study(
            override_entries(STUDY, [f"{key}={text}"]), CONFIG, "config.yaml"
        )
    )


@given(st.data())
def test_measurements_as_text_are_read_or_refused(cell, data):
    path = cell.folder / "measurements.csv"
    content = path.read_bytes()
    content = data.draw(BYTES | damaged(content) | tables(content))
    assert_read_or_refused_from(path, content, lambda: read_campaign(cell.open()))


@pytest.fixture(scope="module")
def parquet(tmp_path_factory):
    """A valid campaign whose measurements are a parquet file."""
    cell = Cell(tmp_path_factory.mktemp("parquet"))
    cell.write("parquet")
    return cell


def draw_with_odd_column(data, table):
    """Draw a parquet file of a table with one column replaced; None if there is no such
    file."""
    index = data.draw(st.integers(0, table.num_columns - 1))
    name = data.draw(
        st.sampled_from([table.column_names[index], "x", "target", "é\n", ""])
    )
    file = pa.BufferOutputStream()
    try:
        values = data.draw(ARRAYS)
        column = values.take([row % len(values) for row in range(len(table))])
        pq.write_table(table.set_column(index, name, column), file)
    except pa.ArrowException:
        return None
    return file.getvalue().to_pybytes()


@given(st.data())
def test_measurements_as_parquet_are_read_or_refused(parquet, data):
    path = parquet.folder / "measurements.parquet"
    if data.draw(st.booleans()):
        framed = st.binary(max_size=100).map(lambda inner: b"PAR1" + inner + b"PAR1")
        content = data.draw(damaged(path.read_bytes()) | framed)
    else:
        content = draw_with_odd_column(data, pa.table(parquet.table))
    if content is not None:
        assert_read_or_refused_from(
            path, content, lambda: read_campaign(parquet.open())
        )
