"""All effects that are there: whatever a module of this package makes one by
`effect`."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

import elastocal.effects
from elastocal.effects.protocol import Effect, require_unique
from elastocal.errors import InputError
from elastocal.io.modules import list_modules

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.effects.protocol import Candidate
    from elastocal.mechanics.sites import Sites


@cache
def effects() -> dict[str, Effect]:
    """Effects of the catalogue by their names, sorted."""
    modules = [
        import_module(f"elastocal.effects.{name}")
        for name in list_modules(elastocal.effects)
    ]
    found = {
        id(each): each
        for module in modules
        for each in vars(module).values()
        if isinstance(each, Effect)
    }
    require_unique([each.name for each in found.values()])
    return dict(sorted((each.name, each) for each in found.values()))


def candidates_on(sites: Sites) -> dict[str, Candidate]:
    """Every way in which an effect of the catalogue can act on a robot, by their
    keys."""
    found = [
        candidate for each in effects().values() for candidate in each.candidates(sites)
    ]
    require_unique([candidate.key for candidate in found])
    return {candidate.key: candidate for candidate in found}


def moves_robot(candidate: Candidate) -> bool:
    """Whether a candidate moves the robot, as its effect says; springs and declared
    weights, which are no effects, do."""
    known = effects().get(candidate.effect)
    return not candidate.of_setup and (known is None or known.moves_robot)


def declared_candidates(
    names: Iterable[str], sites: Sites, source: str = "declared"
) -> list[Candidate]:
    """All candidates of the effects that a campaign declares; `InputError` with the
    `source`: one that there is not."""
    for name in names:
        if name not in effects():
            raise InputError(source, "declared", repr(name), ", ".join(effects()))
    return [
        candidate for name in names for candidate in effects()[name].candidates(sites)
    ]
