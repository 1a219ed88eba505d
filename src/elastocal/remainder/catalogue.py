"""All regressions that are there: each module of this package that has a NAME."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, cast

import elastocal.remainder

if TYPE_CHECKING:
    from elastocal.remainder.protocol import Regression


@cache
def regressions() -> dict[str, Regression]:
    """Modules of the catalogue by the name of their regression."""
    names = sorted(module.name for module in pkgutil.iter_modules(elastocal.remainder.__path__))
    modules = [import_module(f"elastocal.remainder.{name}") for name in names]
    return {module.NAME: cast("Regression", module) for module in modules if hasattr(module, "NAME")}
