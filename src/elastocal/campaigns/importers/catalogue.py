"""All importers that are there: each module of this package that has FILES."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Protocol, cast

import elastocal.campaigns.importers as package
from elastocal.errors import InputError
from elastocal.io.modules import module_names, modules_with

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from elastocal.campaigns.public_data import PublicFile


class Importer(Protocol):
    """A module of this package that makes campaigns of a public source.

    `FILES`: of the source, by the names that a campaign of config/campaigns has for them. `ROBOTS`: robots of config/robots
    that its campaigns name or that it reads. `write_campaign`: ``write_campaign(*paths, folder, name=..., holdout=...)``, with
    the paths of the files that the campaign names.
    """

    FILES: Mapping[str, PublicFile]
    ROBOTS: tuple[str, ...]
    write_campaign: Callable[..., None]


def importer(name: str, source: str | Path) -> Importer:
    """An importer by its name.

    `name`: of its module. `source`: file that names it, for the message. Raises `InputError`: there is none of this name.
    """
    check_importer(name, source)
    module = import_module(f"{package.__name__}.{name}")
    if not hasattr(module, "FILES"):
        raise _refuse_name(name, source)
    return cast("Importer", module)


def check_importer(name: str, source: str | Path) -> None:
    """Refuse a name that no module has, without the time that it takes to import one.

    Raises `InputError`.
    """
    if name not in module_names(package):
        raise _refuse_name(name, source)


def importers() -> dict[str, Importer]:
    """All of them by their names."""
    return {name: cast("Importer", module) for name, module in modules_with("FILES", package).items()}


def _refuse_name(name: str, source: str | Path) -> InputError:
    return InputError(source, "importer", repr(name), ", ".join(importers()))
