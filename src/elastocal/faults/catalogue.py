"""All faults that are looked for: each module of this package that has a NAME."""

import pkgutil
from functools import cache
from importlib import import_module

import elastocal.faults


@cache
def known_faults():
    """Modules of the package by the name of their fault, each behind those that it comes after.

    Returns
    -------
    dict of str to module
    """
    names = sorted(module.name for module in pkgutil.iter_modules(elastocal.faults.__path__))
    modules = [import_module(f"elastocal.faults.{name}") for name in names]
    waiting = {module.NAME: module for module in modules if hasattr(module, "NAME")}
    ordered = {}
    while waiting:
        ready = [name for name, module in waiting.items() if not set(module.AFTER) & set(waiting)]
        if not ready:
            raise ValueError(f"faults that come after each other: {', '.join(waiting)}")
        ordered |= {name: waiting.pop(name) for name in ready}
    return ordered
