"""All kinds of measurement: those of the modules of this package, and those that other
installed packages offer by an entry point (see `io.plugins`)."""

from __future__ import annotations

from functools import cache
from importlib import import_module

import elastocal.measuring
from elastocal.io import plugins
from elastocal.io.modules import list_modules
from elastocal.measuring.protocol import Kind


@cache
def list_kinds() -> dict[str, Kind]:
    """Kinds of this package and of plug-ins, by name, sorted.

    Raises `InputError`, which names the package: a plug-in cannot be loaded.
    """
    bundled = list_bundled_kinds()
    offered = plugins.load_plugins(plugins.KINDS, Kind, bundled)
    return dict(sorted((bundled | offered).items()))


@cache
def list_bundled_kinds() -> dict[str, Kind]:
    """Kinds of the modules of this package, by name, sorted."""
    kinds = {}
    for name in list_modules(elastocal.measuring):
        module = import_module(f"elastocal.measuring.{name}")
        for value in vars(module).values():
            if isinstance(value, Kind):
                kinds[value.name] = value
    return dict(sorted(kinds.items()))
