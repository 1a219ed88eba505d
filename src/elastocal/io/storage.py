"""Tables on disk: Parquet files that carry their units and their provenance.

A file is one tidy table. Each column's unit and meaning stand in its field metadata; the file's own metadata hold the name of
the schema and the provenance. Row groups are blocks of data sets, so that any number of them is worked off in the same memory.
That a file is as it was written says its record, see `io.records`.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from elastocal.errors import InputError
from elastocal.io.atomic_writes import atomic_write
from elastocal.io.texts import check_file

# Of each column one value or an array.
Block = Mapping[str, np.ndarray | Sequence[str] | Sequence[float]]
_TABLE, _PROVENANCE = "elastocal.table", "elastocal.provenance"
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


def write_table(path: str | Path, schema: TableSchema, blocks: Iterable[Block], provenance: Mapping[str, Any]) -> None:
    """Write a table block by block, each a row group; the file appears whole or not at all.

    `blocks`: one value or array for each column; all arrays of a block have the same length. `provenance`: JSON-serialisable;
    says from what the table was made. Raises `InputError`: a column that is missing, too many, not finite or out of range.
    """
    fields = [pa.field(c.name, _arrow_type(c), False, {"unit": c.unit, "meaning": c.meaning}) for c in schema.columns]
    floats = [c.name for c in schema.columns if c.type.startswith("float")]
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
            if len(next(iter(values.values()))):
                arrays = [_array(values[c.name], _arrow_type(c)) for c in schema.columns]
                writer.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), row_group_size=2**30)
        metadata = {_TABLE: schema.name, _PROVENANCE: provenance}
        writer.add_key_value_metadata({key: json.dumps(value, sort_keys=True) for key, value in metadata.items()})


def read_blocks(
    path: str | Path, schema: TableSchema, columns: Sequence[str] | None = None, **where: str | float
) -> Iterator[dict[str, np.ndarray]]:
    """Read a table block by block, checked against its schema.

    `columns`: only these; all without. `**where`: column = value: only row groups with this value throughout. Raises
    `InputError`: a file that cannot be read or is another table.
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
        positions = {file.metadata.schema.column(i).path: i for i in range(file.metadata.num_columns)}
        for group in range(file.num_row_groups):
            if any(_constant(file, group, positions[name]) != value for name, value in where.items()):
                continue
            try:
                table = file.read_row_group(group, [c.name for c in wanted], use_threads=False)
            except (OSError, pa.ArrowException) as error:
                raise InputError(path, f"row group {group}", f"unreadable data ({error})", _AS_WRITTEN) from None
            yield {c.name: np.concatenate([_values(chunk) for chunk in table.column(c.name).chunks]) for c in wanted}


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


def _array(values: np.ndarray, kind: pa.DataType) -> pa.Array:
    """Values of one column; `pyarrow.array` and ``to_numpy`` would import pandas, half of the time of a job of the study."""
    if pa.types.is_dictionary(kind):
        codes = {text: code for code, text in enumerate(dict.fromkeys(values))}
        texts = [text.encode() for text in codes]
        ends = pa.py_buffer(np.cumsum([0, *map(len, texts)], dtype=np.int32))
        names = pa.StringArray.from_buffers(len(texts), ends, pa.py_buffer(b"".join(texts)))
        coded = np.fromiter(map(codes.__getitem__, values), np.int32, len(values))
        return pa.DictionaryArray.from_arrays(_array(coded, kind.index_type), names)
    if pa.types.is_string(kind):
        return pa.array(values, kind)
    bits = np.packbits(values, bitorder="little") if values.dtype == bool else np.ascontiguousarray(values)
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(bits)])


def _values(chunk: pa.Array) -> np.ndarray:
    if pa.types.is_dictionary(chunk.type):
        return np.array(chunk.dictionary.to_pylist(), dtype=object)[np.from_dlpack(chunk.indices)]
    if pa.types.is_string(chunk.type):
        return chunk.to_numpy(zero_copy_only=False)
    return np.array(chunk.to_pylist(), bool) if pa.types.is_boolean(chunk.type) else np.from_dlpack(chunk)


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
