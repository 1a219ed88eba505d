"""Tables on disk: Parquet files that carry their units and their provenance.

A file is one tidy table. Each column's unit and meaning stand in its field metadata;
the file's own metadata hold the name of the schema and the provenance. Row groups are
blocks of data sets, so that any number of them is worked off in the same memory. That a
file is as it was written says its record, see `io.records`.
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
_TABLE = "elastocal.table"
_PROVENANCE = "elastocal.provenance"
# One value for each row group, and one for each row.
_TEXTS = ("string", "text")
_AS_WRITTEN = "the file as the pipeline wrote it (delete it and it is made again)"


@dataclass(frozen=True)
class Column:
    """One column of a table.

    `type`: a string column has one value for each row group, a text column one for each
    row. `unit`: empty for counts, names and shares. `missing`: whether a floating-point
    column may hold not-a-number or infinity.
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


def write_table(
    path: str | Path,
    schema: TableSchema,
    blocks: Iterable[Block],
    provenance: Mapping[str, Any],
) -> None:
    """Write a table block by block, each a row group; the file appears whole or not at
    all.

    `blocks`: one value or array for each column; all arrays of a block have the same
    length. `provenance`: JSON-serialisable; says from what the table was made. Raises
    `InputError`: a column that is missing, too many, not finite or out of range.
    """
    fields = pa.schema(
        [
            pa.field(
                c.name, _arrow_type(c), False, {"unit": c.unit, "meaning": c.meaning}
            )
            for c in schema.columns
        ]
    )
    floats = [c.name for c in schema.columns if c.type.startswith("float")]
    coded = [c.name for c in schema.columns if c.name not in floats]
    kind = {
        "compression": "zstd",
        "compression_level": 1,
        "use_dictionary": coded,
        "use_byte_stream_split": floats,
    }
    with (
        atomic_write(path) as partial,
        pq.ParquetWriter(partial, fields, **kind) as writer,
    ):
        for block in blocks:
            arrays = [
                _array(values, fields.field(name).type)
                for name, values in _checked(path, schema, block).items()
            ]
            if len(arrays[0]):
                writer.write_table(
                    pa.Table.from_arrays(arrays, schema=fields), row_group_size=2**30
                )
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
    """Read a table block by block, checked against its schema.

    `columns`: only these; all without. `**where`: column = value: only row groups with
    this value throughout. Raises `InputError`: a file that cannot be read or is another
    table.
    """
    wanted = [c.name for c in schema.columns] if columns is None else [*columns]
    with _parquet_file(path) as file:
        name = _metadata(path, file, _TABLE, schema.name)
        if name != schema.name:
            raise InputError(path, f"metadata {_TABLE}", name, schema.name)
        types = {field.name: field.type for field in file.schema_arrow}
        for column in schema.columns:
            if types.get(column.name) != _arrow_type(column):
                found = (
                    f"type {types[column.name]}" if column.name in types else "nothing"
                )
                raise InputError(
                    path, f"column {column.name}", found, f"type {_arrow_type(column)}"
                )
        positions = {
            file.metadata.schema.column(i).path: i
            for i in range(file.metadata.num_columns)
        }
        for group in range(file.num_row_groups):
            if any(
                _constant(file, group, positions[name]) != value
                for name, value in where.items()
            ):
                continue
            try:
                table = file.read_row_group(group, wanted, use_threads=False)
            except (OSError, pa.ArrowException) as error:
                raise InputError(
                    path,
                    f"row group {group}",
                    f"unreadable data ({error})",
                    _AS_WRITTEN,
                ) from None
            yield {
                name: np.concatenate(
                    [_values(chunk) for chunk in table.column(name).chunks]
                )
                for name in wanted
            }


def read_table(
    path: str | Path,
    schema: TableSchema,
    columns: Sequence[str] | None = None,
    **where: str | float,
) -> dict[str, np.ndarray]:
    """Read a whole table; as `read_blocks`, with the blocks joined."""
    blocks = list(read_blocks(path, schema, columns, **where))
    if where and not blocks:
        raise InputError(
            path,
            ", ".join(where),
            ", ".join(map(repr, where.values())),
            "values in the file",
        )
    wanted = [c for c in schema.columns if columns is None or c.name in columns]
    none = {c.name: np.zeros(0, object if c.type in _TEXTS else c.type) for c in wanted}
    return {
        name: np.concatenate([block[name] for block in blocks or [none]])
        for name in none
    }


def read_provenance(path: str | Path) -> dict[str, Any]:
    """Provenance of a table, as it was given to `write_table`."""
    with _parquet_file(path) as file:
        return _metadata(path, file, _PROVENANCE)


def _parquet_file(path: str | Path) -> pq.ParquetFile:
    try:
        check_file(path)
        return pq.ParquetFile(path)
    except (OSError, pa.ArrowException) as error:
        raise InputError(
            path, "", f"no readable Parquet file ({error})", _AS_WRITTEN
        ) from None


def _metadata(
    path: str | Path, file: pq.ParquetFile, key: str, allowed: str = _AS_WRITTEN
) -> Any:
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
    return (
        pa.dictionary(pa.int32(), pa.string())
        if column.type == "string"
        else pa.type_for_alias(column.type)
    )


def _array(values: np.ndarray, kind: pa.DataType) -> pa.Array:
    """Values of one column; `pyarrow.array` and ``to_numpy`` would import pandas, half
    of the time of a job of the study."""
    if pa.types.is_dictionary(kind):
        codes = {text: code for code, text in enumerate(dict.fromkeys(values))}
        texts = [text.encode() for text in codes]
        ends = pa.py_buffer(np.cumsum([0, *map(len, texts)], dtype=np.int32))
        names = pa.StringArray.from_buffers(
            len(texts), ends, pa.py_buffer(b"".join(texts))
        )
        coded = np.fromiter(map(codes.__getitem__, values), np.int32, len(values))
        return pa.DictionaryArray.from_arrays(_array(coded, kind.index_type), names)
    if pa.types.is_string(kind):
        return pa.array(values, kind)
    bits = (
        np.packbits(values, bitorder="little")
        if values.dtype == bool
        else np.ascontiguousarray(values)
    )
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(bits)])


def _values(chunk: pa.Array) -> np.ndarray:
    if pa.types.is_dictionary(chunk.type):
        return np.array(chunk.dictionary.to_pylist(), dtype=object)[
            np.from_dlpack(chunk.indices)
        ]
    if pa.types.is_string(chunk.type):
        return chunk.to_numpy(zero_copy_only=False)
    return (
        np.array(chunk.to_pylist(), bool)
        if pa.types.is_boolean(chunk.type)
        else np.from_dlpack(chunk)
    )


def _checked(
    path: str | Path, schema: TableSchema, block: Block
) -> dict[str, np.ndarray]:
    """Arrays of a block in the order of the schema, of one length each."""
    names = [c.name for c in schema.columns]
    if set(block) != set(names):
        raise InputError(
            path,
            "columns",
            ", ".join(sorted(set(block) ^ set(names))),
            f"those of {schema.name}",
        )
    single = {name: value for name, value in block.items() if isinstance(value, str)}
    values = {
        c.name: np.ascontiguousarray(
            block[c.name], object if c.type in _TEXTS else c.type
        )
        for c in schema.columns
    }
    lengths = {len(value) for name, value in values.items() if name not in single}
    if len(lengths) != 1:
        raise InputError(
            path, "rows", f"columns of {sorted(lengths)} rows", "columns of one length"
        )
    (rows,) = lengths
    for column in schema.columns:
        value = values[column.name]
        finite = (
            np.ones(len(value), bool)
            if column.missing or column.type in _TEXTS
            else np.isfinite(value)
        )
        large = (
            np.ones(len(value), bool)
            if column.minimum is None
            else value >= column.minimum
        )
        for good, allowed in (
            (finite, "finite numbers"),
            (large, f">= {column.minimum}"),
        ):
            if not good.all():
                row = int(np.argmin(good))
                raise InputError(
                    path, f"column {column.name}, row {row}", str(value[row]), allowed
                )
    return values | {
        name: np.full(rows, value, dtype=object) for name, value in single.items()
    }
