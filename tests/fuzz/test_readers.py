"""Whatever bytes a file holds, its reader gives a value or an InputError of one short line, in bounded time, and no more."""

import json

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from fuzzed import BYTES, SCALARS, VALUES, any_document, damaged, holds, over, tables
from hypothesis import given
from hypothesis import strategies as st
from made_cells import ARM, DOCUMENT, Cell
from study_folder import REPOSITORY

from elastocal.campaigns.reading import campaign_files, read_campaign, read_robot
from elastocal.campaigns.sources import campaign_sources
from elastocal.io.documents import check_document, read_document
from elastocal.mechanics.chain import parse_chain
from elastocal.study.configuration import check_study, override
from elastocal.study.strategies import check_strategy, strategy_from_document

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


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A valid campaign in a folder, robots beside it; each test writes one file of its own over it and takes it back."""
    cell = Cell(tmp_path_factory.mktemp("fuzz"))
    cell.document = FULL
    cell.write()
    return cell


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
    holds(lambda: check_study(override(STUDY, [f"{key}={text}"]), CONFIG, "config.yaml"))


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
