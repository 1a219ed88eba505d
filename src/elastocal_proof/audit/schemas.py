"""The declared schemas by the name that a file has for itself: what an audit holds a file against."""

from __future__ import annotations

from inspect import isfunction
from typing import TYPE_CHECKING

from elastocal.io.storage import TableSchema
from elastocal.loop import schemas as of_loop
from elastocal.study import table_schemas as of_study
from elastocal_proof.blind import schemas as of_blind
from elastocal_proof.league import schemas as of_league

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType


def _of_module(module: ModuleType) -> dict[str, Callable[[int], TableSchema]]:
    """Schemas that a module states, each as a function of the number of joints."""
    found: dict[str, Callable[[int], TableSchema]] = {}
    for name, value in vars(module).items():
        if name.startswith("_"):
            continue
        if isinstance(value, TableSchema):
            found[value.name] = _constant(value)
        elif isfunction(value) and value.__annotations__.get("return") in (TableSchema, "TableSchema"):
            found[value(1).name] = value
    return found


def _constant(schema: TableSchema) -> Callable[[int], TableSchema]:
    return lambda joints: schema


SCHEMAS = _of_module(of_study) | _of_module(of_loop) | _of_module(of_league) | _of_module(of_blind)
