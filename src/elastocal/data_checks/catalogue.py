"""All faults that are looked for: each module of this package that has NAMES."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import elastocal.data_checks
from elastocal.io.modules import modules_with

if TYPE_CHECKING:
    from types import ModuleType

    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.data_checks.protocol import Fault


@cache
def fault_modules() -> dict[str, ModuleType]:
    """Modules that look for faults by their own names, each behind those that it comes after."""
    waiting = modules_with("NAMES", elastocal.data_checks)
    ordered: dict[str, ModuleType] = {}
    while waiting:
        ready = [name for name, module in waiting.items() if not set(module.AFTER) & set(waiting)]
        if not ready:
            raise ValueError(f"faults that come after each other: {', '.join(waiting)}")
        ordered |= {name: waiting.pop(name) for name in ready}
    return ordered


def faults(campaign: Campaign, measurements: Measurements) -> tuple[Fault, ...]:
    """Every fault that some measurements show; none is looked for where another one makes that meaningless: see `protocol`."""
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
