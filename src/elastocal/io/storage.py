"""Tables on disk: Parquet files that carry their units, their provenance and a digest of their contents.

A file is one tidy table. Each column's unit and meaning stand in its field metadata; the file's own metadata hold the name of
the schema, the provenance and, for each row group and column, a SHA-256 of the values. Row groups are blocks of data sets, so
that any number of them is worked off in the same memory.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from elastocal.errors import InputError
from elastocal.io.atomic_writes import atomic_write
from elastocal.io.texts import check_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path
    from typing import Any

    # Of each column one value or an array.
    Block = Mapping[str, np.ndarray | Sequence[str] | Sequence[float]]

_TABLE, _PROVENANCE, _DIGESTS = "elastocal.table", "elastocal.provenance", "elastocal.sha256"
_AS_WRITTEN = "the file as the pipeline wrote it (delete it and it is made again)"


@dataclass(frozen=True)
class Column:
    """One column of a table.

    `type`: a string column has one value for each row group, a text column one for each row. `unit`: empty for counts, names
    and shares. `missing`: whether a floating-point column may hold not-a-number or infinity.
    """

    name: str
    type: str
    unit: str
    meaning: str
    missing: bool = False
    minimum: float | None = None


@dataclass(frozen=True)
class TableSchema:
    """Name and columns of a table."""

    name: str
    columns: tuple[Column, ...]

    def column(self, name: str) -> Column:
        """The column called `name`."""
        return next(column for column in self.columns if column.name == name)


# What a file is of, where its provenance says so: a column of one value each, which any reader of Parquet finds by itself.
_HEADS = {
    "robot": Column("robot", "string", "", "name of the robot's file"),
    "noise": Column("noise_um", "float64", "µm, µrad", "standard deviation of the measurement noise"),
    "strategy": Column("strategy", "string", "", "name of the strategy's file"),
}


def write_table(path: str | Path, schema: TableSchema, blocks: Iterable[Block], provenance: Mapping[str, Any]) -> None:
    """Write a table block by block, each a row group; the file appears whole or not at all.

    `blocks`: one value or array for each column; all arrays of a block have the same length. `provenance`: JSON-serialisable;
    says from what the table was made; a robot, noise and strategy in it become columns of their own, where the schema has none
    of the name. Raises `InputError`: a column that is missing, too many, not finite or out of range.
    """
    taken = {column.name for column in schema.columns}
    heads = {key: column for key, column in _HEADS.items() if key in provenance and column.name not in taken}
    blocks = ({**block, **_headed(heads, provenance, block)} for block in blocks)
    schema = replace(schema, columns=(*heads.values(), *schema.columns))
    fields = [pa.field(c.name, _arrow_type(c), False, {"unit": c.unit, "meaning": c.meaning}) for c in schema.columns]
    floats = [c.name for c in schema.columns if c.type.startswith("float") and c not in heads.values()]
    digests = []
    with (
        atomic_write(path) as partial,
        pq.ParquetWriter(
            partial,
            pa.schema(fields),
            compression="zstd",
            compression_level=1,
            use_dictionary=[c.name for c in schema.columns if c.name not in floats],
            use_byte_stream_split=floats,
        ) as writer,
    ):
        for block in blocks:
            values = _checked(path, schema, block)
            if not len(next(iter(values.values()))):
                continue
            digests.append({c.name: _digest(c, values[c.name]) for c in schema.columns})
            arrays = [_to_arrow(c, values[c.name], len(next(iter(values.values())))) for c in schema.columns]
            writer.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), row_group_size=2**30)
        metadata = {_TABLE: schema.name, _PROVENANCE: provenance, _DIGESTS: digests}
        writer.add_key_value_metadata({key: json.dumps(value, sort_keys=True) for key, value in metadata.items()})


def read_blocks(
    path: str | Path, schema: TableSchema, columns: Sequence[str] | None = None, **where: str | float
) -> Iterator[dict[str, np.ndarray]]:
    """Read a table block by block, checked against its schema and its digests.

    `columns`: only these; all without. `**where`: column = value: only row groups with this value throughout. Raises
    `InputError`: a file that cannot be read, is another table, or whose contents are not those written.
    """
    wanted = schema.columns if columns is None else [schema.column(name) for name in columns]
    with _parquet_file(path) as file:
        name = _metadata(path, file, _TABLE, schema.name)
        if name != schema.name:
            raise InputError(path, f"metadata {_TABLE}", name, schema.name)
        fields = file.schema_arrow
        for column in schema.columns:
            index = fields.get_field_index(column.name)
            if index < 0 or fields.field(index).type != _arrow_type(column):
                found = "nothing" if index < 0 else f"type {fields.field(index).type}"
                raise InputError(path, f"column {column.name}", found, f"type {_arrow_type(column)}")
        digests = _metadata(path, file, _DIGESTS)
        if len(digests) != file.num_row_groups:
            raise InputError(path, "row groups", str(file.num_row_groups), f"{len(digests)}: {_AS_WRITTEN}")
        positions = {file.metadata.schema.column(i).path: i for i in range(file.metadata.num_columns)}
        for group in range(file.num_row_groups):
            if any(_constant(file, group, positions[name]) != value for name, value in where.items()):
                continue
            try:
                table = file.read_row_group(group, [c.name for c in wanted], use_threads=False)
            except (OSError, pa.ArrowException) as error:
                raise InputError(path, f"row group {group}", f"unreadable data ({error})", _AS_WRITTEN) from None
            block = {c.name: _to_numpy(c, table.column(c.name)) for c in wanted}
            for column in wanted:
                if _digest(column, block[column.name]) != digests[group][column.name]:
                    place = f"column {column.name}, row group {group}"
                    raise InputError(path, place, "values that were edited", _AS_WRITTEN)
            yield block


def read_table(
    path: str | Path, schema: TableSchema, columns: Sequence[str] | None = None, **where: str | float
) -> dict[str, np.ndarray]:
    """Read a whole table; as `read_blocks`, with the blocks joined."""
    blocks = list(read_blocks(path, schema, columns, **where))
    if not blocks and not where:
        wanted = schema.columns if columns is None else [schema.column(name) for name in columns]
        return {c.name: np.zeros(0, object if c.type in ("string", "text") else c.type) for c in wanted}
    if not blocks:
        raise InputError(path, ", ".join(where), ", ".join(map(repr, where.values())), "values in the file")
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def read_provenance(path: str | Path) -> dict[str, Any]:
    """Provenance of a table, as it was given to `write_table`."""
    with _parquet_file(path) as file:
        return _metadata(path, file, _PROVENANCE)


def _parquet_file(path: str | Path) -> pq.ParquetFile:
    try:
        check_file(path)
        return pq.ParquetFile(path)
    except (OSError, pa.ArrowException) as error:
        raise InputError(path, "", f"no readable Parquet file ({error})", _AS_WRITTEN) from None


def _metadata(path: str | Path, file: pq.ParquetFile, key: str, allowed: str = _AS_WRITTEN) -> Any:
    text = (file.metadata.metadata or {}).get(key.encode())
    if text is None:
        raise InputError(path, f"metadata {key}", "nothing", allowed)
    return json.loads(text)


def _constant(file: pq.ParquetFile, group: int, column: int) -> str | float | None:
    statistics = file.metadata.row_group(group).column(column).statistics
    return statistics.min if statistics and statistics.min == statistics.max else None


def _arrow_type(column: Column) -> pa.DataType:
    if column.type == "text":
        return pa.string()
    return pa.dictionary(pa.int32(), pa.string()) if column.type == "string" else pa.type_for_alias(column.type)


def _headed(heads: Mapping[str, Column], provenance: Mapping[str, Any], block: Block) -> dict[str, str | np.ndarray]:
    """One value a column of what a file is of, as long as a block."""
    rows = max((len(values) for values in block.values() if not isinstance(values, str)), default=0)
    return {
        column.name: provenance[key] if column.type == "string" else np.full(rows, float(provenance[key]))
        for key, column in heads.items()
    }


def _checked(path: str | Path, schema: TableSchema, block: Block) -> dict[str, np.ndarray]:
    names = [c.name for c in schema.columns]
    if set(block) != set(names):
        raise InputError(path, "columns", ", ".join(sorted(set(block) ^ set(names))), f"those of {schema.name}")
    values: dict[str, np.ndarray | str] = {}
    for column in schema.columns:
        value = block[column.name]
        if column.type == "text":
            value = np.array(value, dtype=object)
        elif column.type == "string":
            value = value if isinstance(value, str) else np.asarray(value, dtype=object)
        else:
            value = np.ascontiguousarray(value, dtype=column.type)
            if column.type.startswith("float") and not column.missing and not np.isfinite(value).all():
                row = int(np.argmin(np.isfinite(value)))
                raise InputError(path, f"column {column.name}, row {row}", str(value[row]), "finite numbers")
            if column.minimum is not None and (value < column.minimum).any():
                row = int(np.argmax(value < column.minimum))
                raise InputError(path, f"column {column.name}, row {row}", str(value[row]), f">= {column.minimum}")
        values[column.name] = value
    lengths = {len(v) for c, v in values.items() if not isinstance(v, str)}
    if len(lengths) != 1:
        raise InputError(path, "rows", f"columns of {sorted(lengths)} rows", "columns of one length")
    rows = lengths.pop()
    return {n: np.full(rows, v, dtype=object) if isinstance(v, str) else v for n, v in values.items()}


def _digest(column: Column, array: np.ndarray) -> str:
    if column.type in ("string", "text"):
        data: bytes | memoryview = "\n".join(dict.fromkeys(array) if column.type == "string" else array).encode()
    else:
        data = np.ascontiguousarray(array).data
    return hashlib.sha256(data).hexdigest()[:32]


# Arrays go to and from Arrow through their buffers: every other way makes pyarrow import pandas, which takes longer than a job.
def _to_arrow(column: Column, array: np.ndarray, rows: int) -> pa.Array:
    if column.type == "string":
        text = array[0].encode()
        name = pa.Array.from_buffers(pa.string(), 1, [None, _buffer(np.array([0, len(text)], np.int32)), pa.py_buffer(text)])
        return pa.DictionaryArray.from_arrays(_plain(pa.int32(), np.zeros(rows, np.int32)), name)
    if column.type == "text":
        return pa.array(array.tolist(), pa.string())
    return _plain(_arrow_type(column), np.packbits(array, bitorder="little") if column.type == "bool" else array, rows)


def _plain(arrow_type: pa.DataType, array: np.ndarray, rows: int | None = None) -> pa.Array:
    return pa.Array.from_buffers(arrow_type, len(array) if rows is None else rows, [None, _buffer(array)])


def _buffer(array: np.ndarray) -> pa.Buffer:
    return pa.py_buffer(np.ascontiguousarray(array))


def _to_numpy(column: Column, chunked: pa.ChunkedArray) -> np.ndarray:
    array = chunked.combine_chunks() if chunked.num_chunks != 1 else chunked.chunk(0)
    if column.type == "string":
        names = np.array(array.dictionary.to_pylist(), dtype=object)
        return names[_values(array.indices, np.int32)]
    if column.type == "text":
        return np.array(array.to_pylist(), dtype=object)
    if column.type == "bool":
        bits = np.unpackbits(np.frombuffer(array.buffers()[1], np.uint8), bitorder="little")
        return bits[array.offset : array.offset + len(array)].astype(bool)
    return _values(array, column.type)


def _values(array: pa.Array, dtype: str | type[np.generic]) -> np.ndarray:
    return np.frombuffer(array.buffers()[1], dtype)[array.offset : array.offset + len(array)]
