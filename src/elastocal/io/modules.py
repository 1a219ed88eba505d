"""Modules that a catalogue finds by itself: what is added to its package is one file."""

import pkgutil
from importlib import import_module
from types import ModuleType


def module_names(package: ModuleType) -> list[str]:
    """Names of the modules of a package, sorted."""
    return sorted(module.name for module in pkgutil.iter_modules(package.__path__))


def modules_with(attribute: str, package: ModuleType) -> dict[str, ModuleType]:
    """Modules of a package that have an attribute, by their names, sorted."""
    modules = {name: import_module(f"{package.__name__}.{name}") for name in module_names(package)}
    return {name: module for name, module in modules.items() if hasattr(module, attribute)}
