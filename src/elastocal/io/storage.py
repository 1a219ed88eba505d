"""Write and read tables as Parquet files that carry their units and their provenance.

A file is one tidy table. Column metadata hold unit and meaning; file
metadata hold the name of the schema and the provenance. Row groups are blocks of data
sets, so that a table of any length is processed in the same memory. `io.records` checks
that a file is as it was written.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from elastocal.errors import InputError
from elastocal.io.atomic_writes import write_atomically
from elastocal.io.texts import check_file

# Columns of a table, and one of its rows, by the names of the columns.
Columns = Mapping[str, np.ndarray]
Row = Mapping[str, Any]
# One value or an array for each column.
Block = Mapping[str, np.ndarray | Sequence[str] | Sequence[float]]
_TABLE = "elastocal.table"
_PROVENANCE = "elastocal.provenance"
# Column types of text: one value for each row group, and one for each row.
_TEXT_TYPES = ("string", "text")
_AS_WRITTEN = "the file as the pipeline wrote it (delete it and it is made again)"


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    name : name of the column.
    type : numpy type; a "string" column has one value for each row group, a "text"
        column one for each row.
    unit : unit; empty for counts, names and shares.
    meaning : what the values are.
    missing : whether a floating-point column may hold NaN or infinity.
    minimum : smallest allowed value, if any.
    """

    name: str
    type: str
    unit: str
    meaning: str
    missing: bool = False
    minimum: float | None = None

    @property
    def is_text(self) -> bool:
        """Whether the values are texts."""
        return self.type in _TEXT_TYPES


@dataclass(frozen=True)
class TableSchema:
    """Name and columns of a table.

    A column with ``{joint}`` in its name stands for one column of each joint.
    """

    name: str
    columns: tuple[Column, ...]

    def for_joints(self, count: int) -> TableSchema:
        """Return the schema for a robot with so many joints."""
        columns = []
        for column in self.columns:
            copies = count if "{joint}" in column.name else 1
            for joint in range(1, copies + 1):
                name = column.name.format(joint=joint)
                meaning = column.meaning.format(joint=joint)
                columns.append(replace(column, name=name, meaning=meaning))
        return replace(self, columns=tuple(columns))


def read_schemas(module_file: str) -> dict[str, TableSchema]:
    """Read the schemas, by name, from the CSV file beside a module that has its name.

    Each row describes one column of a table by the attributes of `Column`.
    """
    columns_by_table: dict[str, list[Column]] = {}
    text = Path(module_file).with_suffix(".csv").read_text("utf-8")
    for row in csv.DictReader(text.splitlines()):
        minimum = float(row["minimum"]) if row["minimum"] else None
        column = Column(
            row["column"],
            row["type"],
            row["unit"],
            row["meaning"],
            row["missing"] == "yes",
            minimum,
        )
        columns_by_table.setdefault(row["table"], []).append(column)
    return {
        name: TableSchema(name, tuple(columns))
        for name, columns in columns_by_table.items()
    }


def write_table(
    path: str | Path,
    schema: TableSchema,
    blocks: Iterable[Block],
    provenance: Mapping[str, Any],
) -> None:
    """Write a table block by block, each as a row group. The write is atomic.

    Parameters
    ----------
    path : file.
    schema : schema of the table.
    blocks : one value or array for each column; all arrays of a block have one length.
    provenance : configuration and version behind the table; JSON-serialisable.

    Raises
    ------
    InputError
        If a column is missing or unknown, or a value is not finite or out of range.
    """
    fields = pa.schema(
        [
            pa.field(
                column.name,
                _arrow_type(column),
                nullable=False,
                metadata={"unit": column.unit, "meaning": column.meaning},
            )
            for column in schema.columns
        ]
    )
    is_float = {
        column.name: column.type.startswith("float") for column in schema.columns
    }
    options = {
        "compression": "zstd",
        "compression_level": 1,
        "use_dictionary": [name for name in is_float if not is_float[name]],
        "use_byte_stream_split": [name for name in is_float if is_float[name]],
    }
    with (
        write_atomically(path) as partial,
        pq.ParquetWriter(partial, fields, **options) as writer,
    ):
        for block in blocks:
            arrays = [
                _to_arrow(values, fields.field(name).type)
                for name, values in _check_block(path, schema, block).items()
            ]
            if len(arrays[0]):
                table = pa.Table.from_arrays(arrays, schema=fields)
                writer.write_table(table, row_group_size=2**30)
        metadata = {_TABLE: schema.name, _PROVENANCE: provenance}
        writer.add_key_value_metadata(
            {key: json.dumps(value, sort_keys=True) for key, value in metadata.items()}
        )


def read_blocks(
    path: str | Path,
    schema: TableSchema,
    columns: Sequence[str] | None = None,
    **where: str | float,
) -> Iterator[dict[str, np.ndarray]]:
    """Read a table block by block and check it against its schema.

    Parameters
    ----------
    path : file.
    schema : schema of the table.
    columns : columns to read; all if None.
    where : value by column: only row groups that have this value throughout are read.

    Raises
    ------
    InputError
        If the file cannot be read or is another table.
    """
    wanted = [column.name for column in schema.columns]
    if columns is not None:
        wanted = [*columns]
    with _open_parquet(path) as file:
        _check_schema(path, file, schema)
        layout = file.metadata.schema
        positions = {
            layout.column(position).path: position
            for position in range(file.metadata.num_columns)
        }
        for group in range(file.num_row_groups):
            is_selected = all(
                _constant_value(file, group, positions[name]) == value
                for name, value in where.items()
            )
            if is_selected:
                yield _read_row_group(path, file, group, wanted)


def _check_schema(path: str | Path, file: pq.ParquetFile, schema: TableSchema) -> None:
    """Refuse a file that is another table."""
    name = _read_metadata(path, file, _TABLE, schema.name)
    if name != schema.name:
        raise InputError(path, f"metadata {_TABLE}", name, schema.name)
    types = {field.name: field.type for field in file.schema_arrow}
    for column in schema.columns:
        expected = _arrow_type(column)
        if types.get(column.name) != expected:
            finding = (
                f"type {types[column.name]}" if column.name in types else "nothing"
            )
            key = f"column {column.name}"
            raise InputError(path, key, finding, f"type {expected}")


def _read_row_group(
    path: str | Path, file: pq.ParquetFile, group: int, names: Sequence[str]
) -> dict[str, np.ndarray]:
    try:
        table = file.read_row_group(group, names, use_threads=False)
    except (OSError, pa.ArrowException) as error:
        finding = f"unreadable data ({error})"
        raise InputError(path, f"row group {group}", finding, _AS_WRITTEN) from None
    return {name: _to_numpy(table.column(name)) for name in names}


def read_table(
    path: str | Path,
    schema: TableSchema,
    columns: Sequence[str] | None = None,
    **where: str | float,
) -> dict[str, np.ndarray]:
    """Read a whole table: as `read_blocks`, with the blocks joined."""
    blocks = list(read_blocks(path, schema, columns, **where))
    if where and not blocks:
        key = ", ".join(where)
        finding = ", ".join(map(repr, where.values()))
        raise InputError(path, key, finding, "values in the file")
    table = {}
    for column in schema.columns:
        if columns is None or column.name in columns:
            # A table without blocks has columns of the right types.
            empty = np.zeros(0, object if column.is_text else column.type)
            values = [block[column.name] for block in blocks]
            table[column.name] = np.concatenate([empty, *values])
    return table


def read_provenance(path: str | Path) -> dict[str, Any]:
    """Read the provenance of a table, as it was given to `write_table`."""
    with _open_parquet(path) as file:
        provenance: dict[str, Any] = _read_metadata(path, file, _PROVENANCE)
        return provenance


def _open_parquet(path: str | Path) -> pq.ParquetFile:
    try:
        check_file(path)
        return pq.ParquetFile(path)
    except (OSError, pa.ArrowException) as error:
        finding = f"no readable Parquet file ({error})"
        raise InputError(path, "", finding, _AS_WRITTEN) from None


def _read_metadata(
    path: str | Path, file: pq.ParquetFile, key: str, allowed: str = _AS_WRITTEN
) -> Any:
    metadata = file.metadata.metadata or {}
    text = metadata.get(key.encode())
    if text is None:
        raise InputError(path, f"metadata {key}", "nothing", allowed)
    return json.loads(text)


def _constant_value(
    file: pq.ParquetFile, group: int, column: int
) -> str | float | None:
    """Return the value that a column has throughout a row group, or None."""
    statistics = file.metadata.row_group(group).column(column).statistics
    if statistics and statistics.min == statistics.max:
        value: str | float = statistics.min
        return value
    return None


def _arrow_type(column: Column) -> pa.DataType:
    if column.type == "text":
        return pa.string()
    if column.type == "string":
        return pa.dictionary(pa.int32(), pa.string())
    return pa.type_for_alias(column.type)


def _to_arrow(values: np.ndarray, kind: pa.DataType) -> pa.Array:
    """Convert the values of a column.

    `pyarrow.array` and ``to_numpy`` would import pandas, which takes half of the time
    of a job of the study.
    """
    if pa.types.is_dictionary(kind):
        codes = {text: code for code, text in enumerate(dict.fromkeys(values))}
        texts = [text.encode() for text in codes]
        ends = pa.py_buffer(np.cumsum([0, *map(len, texts)], dtype=np.int32))
        names = pa.StringArray.from_buffers(
            len(texts), ends, pa.py_buffer(b"".join(texts))
        )
        coded = np.fromiter(map(codes.__getitem__, values), np.int32, len(values))
        return pa.DictionaryArray.from_arrays(_to_arrow(coded, kind.index_type), names)
    if pa.types.is_string(kind):
        return pa.array(values, kind)
    if values.dtype == bool:
        bits = np.packbits(values, bitorder="little")
    else:
        bits = np.ascontiguousarray(values)
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(bits)])


def _to_numpy(column: pa.ChunkedArray) -> np.ndarray:
    return np.concatenate([_chunk_to_numpy(chunk) for chunk in column.chunks])


def _chunk_to_numpy(chunk: pa.Array) -> np.ndarray:
    if pa.types.is_dictionary(chunk.type):
        texts = np.array(chunk.dictionary.to_pylist(), dtype=object)
        return np.asarray(texts[np.from_dlpack(chunk.indices)])
    if pa.types.is_string(chunk.type):
        return np.asarray(chunk.to_numpy(zero_copy_only=False))
    if pa.types.is_boolean(chunk.type):
        return np.array(chunk.to_pylist(), bool)
    return np.from_dlpack(chunk)


def _check_block(
    path: str | Path, schema: TableSchema, block: Block
) -> dict[str, np.ndarray]:
    """Return the arrays of a block in the order of the schema, all of one length;
    refuse a value that the schema does not allow."""
    names = [column.name for column in schema.columns]
    if set(block) != set(names):
        different = ", ".join(sorted(set(block) ^ set(names)))
        raise InputError(path, "columns", different, f"the columns of {schema.name}")
    arrays = {
        column.name: np.ascontiguousarray(
            block[column.name], object if column.is_text else column.type
        )
        for column in schema.columns
    }
    # A single text stands for a column of equal texts.
    texts = {name: value for name, value in block.items() if isinstance(value, str)}
    lengths = {len(array) for name, array in arrays.items() if name not in texts}
    if len(lengths) != 1:
        finding = f"columns of {sorted(lengths)} rows"
        raise InputError(path, "rows", finding, "columns of one length")
    for column in schema.columns:
        _check_values(path, column, arrays[column.name])
    (rows,) = lengths
    for name, text in texts.items():
        arrays[name] = np.full(rows, text, dtype=object)
    return arrays


def _check_values(path: str | Path, column: Column, values: np.ndarray) -> None:
    """Refuse the first value that is not finite or below the minimum."""
    checks = {}
    if not column.missing and not column.is_text:
        checks["finite numbers"] = np.isfinite(values)
    if column.minimum is not None:
        checks[f">= {column.minimum:g}"] = values >= column.minimum
    for allowed, is_allowed in checks.items():
        if not is_allowed.all():
            row = int(np.argmin(is_allowed))
            key = f"column {column.name}, row {row}"
            raise InputError(path, key, str(values[row]), allowed)
