"""Modules that a catalogue finds by itself: what is added to its package is one
file."""

import pkgutil
from types import ModuleType


def list_modules(package: ModuleType) -> list[str]:
    """Names of the modules of a package, sorted."""
    return sorted(module.name for module in pkgutil.iter_modules(package.__path__))
