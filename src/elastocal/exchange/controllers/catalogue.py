"""All languages that are there: each module of this package that has a NAME."""

from typing import cast

import elastocal.exchange.controllers
from elastocal.errors import InputError
from elastocal.exchange.controllers.protocol import Controller
from elastocal.io.modules import modules_with


def controllers() -> dict[str, Controller]:
    """Modules by the names of their languages."""
    modules = modules_with("NAME", elastocal.exchange.controllers)
    return {module.NAME: cast("Controller", module) for module in modules.values()}


def controller_of(name: str, suffix: str) -> Controller | None:
    """The language of a name; without one that of a file's suffix, None where it is none's. An unknown name is refused."""
    found = controllers()
    if name and name not in found:
        raise InputError("--format", "", repr(name), " | ".join(found))
    return found[name] if name else next((each for each in found.values() if suffix.lower() == each.SUFFIX), None)
