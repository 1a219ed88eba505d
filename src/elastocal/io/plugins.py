"""Effects, importers, controllers, regressions and kinds of measurement that other
installed packages offer.

A package offers an object by an entry point in one of the groups below; the name of
the entry point is its name in the catalogue:

    [project.entry-points."elastocal.effects"]
    hoses = "my_package.hoses:hoses"

References
----------
Python Packaging User Guide, Entry points specification.
"""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, TypeVar

from elastocal.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Collection

    Plugin = TypeVar("Plugin")

EFFECTS = "elastocal.effects"
IMPORTERS = "elastocal.importers"
CONTROLLERS = "elastocal.controllers"
REGRESSIONS = "elastocal.regressions"
KINDS = "elastocal.kinds"
GROUPS = (EFFECTS, IMPORTERS, CONTROLLERS, REGRESSIONS, KINDS)


def load_plugins(
    group: str, kind: type[Plugin], reserved_names: Collection[str]
) -> dict[str, Plugin]:
    """Load what installed packages offer in one group.

    Parameters
    ----------
    group : one of `GROUPS`
    kind : class that every object of the group must have
    reserved_names : names of this package, which no plug-in may take

    Returns
    -------
    Objects by their names, sorted.

    Raises
    ------
    InputError
        A plug-in cannot be imported, is of another class, or has a name that is taken.
        The error names the package.
    """
    plugins: dict[str, Plugin] = {}
    for entry in sorted(entry_points(group=group), key=lambda entry: entry.name):
        if entry.name in reserved_names or entry.name in plugins:
            raise _plugin_error(entry, "a name that is taken", "another name")
        plugins[entry.name] = _load_plugin(entry, kind)
    return plugins


def list_plugin_names(group: str) -> list[str]:
    """List the names that installed packages offer in one group, without an import."""
    return sorted(entry.name for entry in entry_points(group=group))


def list_plugin_versions() -> dict[str, str]:
    """List the versions of the installed packages that offer plug-ins, by their names."""
    # Each call reads the metadata of every installed package.
    offered = entry_points()
    distributions = [
        entry.dist for group in GROUPS for entry in offered.select(group=group)
    ]
    return {
        distribution.name: distribution.version
        for distribution in distributions
        if distribution is not None
    }


def _load_plugin(entry: EntryPoint, kind: type[Plugin]) -> Plugin:
    allowed = f"an object of elastocal's class {kind.__name__}"
    try:
        plugin = entry.load()
    # Code of a third party may raise anything while it is imported.
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise _plugin_error(entry, reason, allowed) from error
    if not isinstance(plugin, kind):
        raise _plugin_error(entry, f"{entry.value}, a {type(plugin).__name__}", allowed)
    own_name = getattr(plugin, "name", entry.name)
    if own_name != entry.name:
        allowed = f"the entry point under the object's own name, {own_name!r}"
        raise _plugin_error(entry, entry.name, allowed)
    return plugin


def _plugin_error(entry: EntryPoint, finding: str, allowed: str) -> InputError:
    package = entry.dist.name if entry.dist is not None else entry.module
    return InputError(
        f"package {package}", f"{entry.group} {entry.name}", finding, allowed
    )
