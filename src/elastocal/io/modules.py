"""List the modules of a package, so that a new module enters a catalogue by itself."""

import pkgutil
from types import ModuleType


def list_modules(package: ModuleType) -> list[str]:
    """List the names of the modules of a package, sorted."""
    return sorted(module.name for module in pkgutil.iter_modules(package.__path__))
