"""List the modules of a package and the objects that they define, so that a new module
enters a catalogue by itself."""

import pkgutil
from importlib import import_module
from types import ModuleType
from typing import TypeVar

Entry = TypeVar("Entry")


def list_modules(package: ModuleType) -> list[str]:
    """List the names of the modules of a package, sorted."""
    return sorted(module.name for module in pkgutil.iter_modules(package.__path__))


def list_entries(package: ModuleType, kind: type[Entry]) -> list[Entry]:
    """List the objects of a class that the modules of a package define, each once."""
    modules = [
        import_module(f"{package.__name__}.{name}") for name in list_modules(package)
    ]
    # A module that imports an object of another one does not define it again.
    entries = {
        id(value): value
        for module in modules
        for value in vars(module).values()
        if isinstance(value, kind)
    }
    return list(entries.values())
