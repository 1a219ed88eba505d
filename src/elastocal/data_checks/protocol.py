"""What every fault of the data is: a name, what the data resemble in plain words, and how much better they fit without it.

Faults are looked for by the modules of this package, each with

- ``NAMES`` of the faults that it may find and their ``FAMILY``;
- ``AFTER``, the modules whose decisive faults make it meaningless to look for these;
- ``find(campaign, measurements)``, which lists the faults of these names that the measurements show.

Nothing else knows the faults by name: a new module is new faults. Where it is ambiguous none is found: a false alarm stops a
trace that was right, a miss only leaves it to what comes after.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import elastocal.data_checks
from elastocal.io.modules import modules_with

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import ModuleType

    from elastocal.campaigns.campaign import Campaign, Measurements

# Family of faults of the data among the effects of a verdict.
OF_DATA = "data"


@dataclass(frozen=True)
class Value:
    """One number that describes a fault.

    `unit`: "–" where it has none.
    """

    name: str
    value: float
    unit: str


@dataclass(frozen=True)
class Fault:
    """A fault that the measurements show.

    `name`: one of the ``NAMES`` of a module. `joints`: joints concerned, counted from 1; empty where there are none. `detail`:
    one sentence in plain words. `evidence`: RMS residual as written and with the correction, m. Where only orientations show
    the fault: of a point 1 m away. `rows`: rows of the file concerned; empty where all are. `decisive`: whether the
    measurements must be corrected before anything is traced. `alternatives`: what would explain the measurements as well, in
    plain words.
    """

    name: str
    joints: tuple[int, ...]
    detail: str
    parameters: tuple[Value, ...]
    evidence: tuple[float, float]
    rows: tuple[int, ...]
    decisive: bool
    alternatives: tuple[str, ...] = ()


def data_at_fault(verdict: Mapping[str, Any]) -> bool:
    """Whether the document of a diagnosis or verdict finds a fault of the data, after which it says nothing of the robot."""
    return any(effect["family"] == OF_DATA for effect in verdict["effects"])


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
