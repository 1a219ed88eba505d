"""All kinds of measurement: those of the modules of this package, and those that other
installed packages offer by an entry point (see `io.plugins`)."""

from __future__ import annotations

from functools import cache

import elastocal.measuring
from elastocal.io import plugins
from elastocal.io.modules import list_entries
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
    kinds = list_entries(elastocal.measuring, Kind)
    return dict(sorted((kind.name, kind) for kind in kinds))
