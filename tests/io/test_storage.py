"""Tables survive writing and reading, and a file that is not as written is refused."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support import refused

from elastocal.io.storage import (
    Column,
    TableSchema,
    read_blocks,
    read_provenance,
    read_table,
    write_table,
)

SCHEMA = TableSchema(
    "things",
    (
        Column("kind", "string", "", "kind of thing; one for each row group"),
        Column("number", "int32", "", "number of the thing", minimum=0),
        Column("length", "float64", "m", "how long it is"),
        Column("share", "float32", "", "share of it", missing=True),
        Column("good", "bool", "", "whether it is any good"),
    ),
)
ORIGIN = {"elastocal_version": "0.1.0", "configuration": {"seed": 1}, "noise_um": 200}


def block(kind, first, rows=3, **changes):
    numbers = np.arange(first, first + rows)
    columns = {
        "kind": kind,
        "number": numbers,
        "length": 0.1 * numbers,
        "share": np.where(numbers % 2, np.nan, numbers / 3),
    }
    return {
        name: values
        for name, values in (columns | {"good": numbers % 3 == 0} | changes).items()
        if values is not None
    }


@pytest.fixture
def new(tmp_path):
    """Path without a table."""
    return str(tmp_path / "new.parquet")


@pytest.fixture
def path(tmp_path):
    """A table of three row groups."""
    path = str(tmp_path / "things.parquet")
    write_table(path, SCHEMA, [block("a", 0), block("b", 3, 2), block("a", 5)], ORIGIN)
    return path


def rewrite(path, change):
    """Change the contents of a file as another program would, with the same metadata and
    row groups."""
    with pq.ParquetFile(path) as file:
        metadata = {
            k: v
            for k, v in file.metadata.metadata.items()
            if k.startswith(b"elastocal")
        }
        groups = [change(file.read_row_group(i)) for i in range(file.num_row_groups)]
    with pq.ParquetWriter(path, groups[0].schema) as writer:
        for group in groups:
            writer.write_table(group)
        writer.add_key_value_metadata(metadata)


def test_a_table_survives_writing_and_reading(path):
    table = read_table(path, SCHEMA)
    np.testing.assert_array_equal(table["kind"], list("aaabbaaa"))
    np.testing.assert_array_equal(table["number"], np.arange(8))
    np.testing.assert_array_equal(table["length"], 0.1 * np.arange(8))
    np.testing.assert_array_equal(
        table["share"],
        np.where(np.arange(8) % 2, np.nan, np.arange(8) / 3).astype("f4"),
    )
    np.testing.assert_array_equal(table["good"], np.arange(8) % 3 == 0)
    assert [table[c.name].dtype for c in SCHEMA.columns[1:]] == [
        "int32",
        "float64",
        "float32",
        "bool",
    ]


def test_only_row_groups_with_the_value_asked_for_are_read(path):
    assert [b["number"].tolist() for b in read_blocks(path, SCHEMA, kind="a")] == [
        [0, 1, 2],
        [5, 6, 7],
    ]
    assert read_table(path, SCHEMA, ["number"], kind="b")["number"].tolist() == [3, 4]
    assert list(read_blocks(path, SCHEMA, kind="c")) == []


@pytest.mark.parametrize(
    ("changes", "key", "phrases"),
    [
        ({"length": [0.1, np.nan, 0.3]}, "column length, row 1", ["nan", "finite"]),
        ({"number": [0, 4, -2]}, "column number, row 2", ["-2", ">= 0"]),
        ({"length": [0.1, 0.2]}, "rows", ["2, 3", "one length"]),
        ({"width": [1, 2, 3]}, "columns", ["width", "things"]),
    ],
)
def test_faulty_values_are_not_written(new, changes, key, phrases):
    with refused(new, key, *phrases):
        write_table(new, SCHEMA, [block("a", 0), block("a", 3, **changes)], {})
    assert not Path(new).exists()


def test_a_truncated_file_and_another_table_are_refused(path, new):
    whole = Path(path).read_bytes()
    for share in (0.0, 0.3, 0.999):
        Path(new).write_bytes(whole[: int(share * len(whole))])
        with refused(new, "", "Parquet"):
            read_table(new, SCHEMA)
    rewrite(
        path,
        lambda table: table.rename_columns(
            ["kind", "number", "lenght", "share", "good"]
        ),
    )
    with refused(path, "column length", "nothing", "double"):
        read_table(path, SCHEMA)
    pq.write_table(pa.table({"number": [1, 2]}), new)
    with refused(new, "metadata elastocal.table", "nothing", "things"):
        read_table(new, SCHEMA)
    with refused(new, "elastocal.provenance"):
        read_provenance(new)


TEXTS = TableSchema(
    "texts",
    (
        Column("owner", "text", "", "one of its own for each row"),
        Column("kind", "string", "", "one for each row group"),
    ),
)
ODD_TEXTS = ["", "µrad/(N·m)", "a, b\nc", "", "x" * 300]


def test_text_columns_survive_row_by_row(new):
    odd = {"owner": ODD_TEXTS, "kind": "k"}
    more = {"owner": np.array(["a", "b", "a"], dtype=object), "kind": "l"}
    write_table(new, TEXTS, [odd, more], ORIGIN)
    back = read_table(new, TEXTS)
    assert (
        back["owner"].tolist() == [*ODD_TEXTS, "a", "b", "a"]
        and back["kind"].tolist() == ["k"] * 5 + ["l"] * 3
    )
    assert read_table(new, TEXTS, ["owner"], kind="l")["owner"].tolist() == [
        "a",
        "b",
        "a",
    ]
    assert pq.ParquetFile(new).read().column("owner").to_pylist() == [
        *ODD_TEXTS,
        "a",
        "b",
        "a",
    ]


NONE = {"owner": [], "kind": "k"}
SOME = {"owner": ["a"], "kind": "k"}


@pytest.mark.parametrize(
    ("blocks", "rows"), [([], 0), ([NONE], 0), ([NONE, SOME, NONE], 1)]
)
def test_tables_without_rows_survive(blocks, rows, new):
    write_table(new, TEXTS, blocks, ORIGIN)
    back = read_table(new, TEXTS)
    assert {
        name: (len(values), values.dtype) for name, values in back.items()
    } == dict.fromkeys(back, (rows, np.dtype(object)))
    assert (
        list(read_table(new, TEXTS, ["owner"])) == ["owner"]
        and read_provenance(new) == ORIGIN
    )
    assert len(list(read_blocks(new, TEXTS))) == rows
    with refused(new, "metadata elastocal.table", "texts", "things"):
        read_table(new, SCHEMA)
    if not rows:
        with refused(new, "kind", "'k'"):
            read_table(new, TEXTS, kind="k")
