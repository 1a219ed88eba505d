"""All faults that are looked for: each module of this package that has NAMES."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

import elastocal.data_checks

if TYPE_CHECKING:
    from types import ModuleType

    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.data_checks.protocol import Fault


@cache
def fault_modules() -> dict[str, ModuleType]:
    """Modules that look for faults by their own names, each behind those that it comes after."""
    names = sorted(module.name for module in pkgutil.iter_modules(elastocal.data_checks.__path__))
    modules = {name: import_module(f"elastocal.data_checks.{name}") for name in names}
    waiting = {name: module for name, module in modules.items() if hasattr(module, "NAMES")}
    ordered: dict[str, ModuleType] = {}
    while waiting:
        ready = [name for name, module in waiting.items() if not set(module.AFTER) & set(waiting)]
        if not ready:
            raise ValueError(f"faults that come after each other: {', '.join(waiting)}")
        ordered |= {name: waiting.pop(name) for name in ready}
    return ordered


def known_faults() -> set[str]:
    """Names of all faults that may be found."""
    return {name for module in fault_modules().values() for name in module.NAMES}


def faults(campaign: Campaign, measurements: Measurements) -> tuple[Fault, ...]:
    """Every fault that some measurements show.

    Returns a fault is not looked for where another one makes that meaningless: see `faults.protocol`.
    """
    found: list[Fault] = []
    decisive: set[str] = set()
    for name, module in fault_modules().items():
        if decisive & set(module.AFTER):
            continue
        new = module.find(campaign, measurements)
        found += new
        if any(fault.decisive for fault in new):
            decisive.add(name)
    return tuple(found)
