"""All languages that are there: each module of this package that has a NAME."""

from __future__ import annotations

import pkgutil
from importlib import import_module
from typing import TYPE_CHECKING, cast

import elastocal.exchange.controllers
from elastocal.errors import InputError

if TYPE_CHECKING:
    from elastocal.exchange.controllers.protocol import Controller


def controllers() -> dict[str, Controller]:
    """Modules by the names of their languages."""
    package = elastocal.exchange.controllers
    names = sorted(module.name for module in pkgutil.iter_modules(package.__path__))
    modules = [import_module(f"{package.__name__}.{name}") for name in names]
    return {module.NAME: cast("Controller", module) for module in modules if hasattr(module, "NAME")}


def controller_of(name: str, suffix: str) -> Controller | None:
    """The language of a name; without one that of a file's suffix, None where it is none's. An unknown name is refused."""
    found = controllers()
    if name and name not in found:
        raise InputError("--format", "", repr(name), " | ".join(found))
    return found[name] if name else next((each for each in found.values() if suffix.lower() == each.SUFFIX), None)
