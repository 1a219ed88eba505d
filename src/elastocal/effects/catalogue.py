"""All effects that are there: each module of this package that has a NAME."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, cast

import elastocal.effects
from elastocal.effects.protocol import require_unique
from elastocal.errors import InputError
from elastocal.io.modules import modules_with

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.effects.protocol import Candidate, Effect
    from elastocal.mechanics.sites import Sites


@cache
def effects() -> dict[str, Effect]:
    """Modules of the catalogue by the name of their effect."""
    return {module.NAME: cast("Effect", module) for module in modules_with("NAME", elastocal.effects).values()}


def candidates_on(sites: Sites) -> dict[str, Candidate]:
    """Every way in which an effect of the catalogue can act on a robot.

    Returns by their keys.
    """
    found = [candidate for module in effects().values() for candidate in module.candidates(sites)]
    require_unique([candidate.key for candidate in found])
    return {candidate.key: candidate for candidate in found}


def declared_candidates(names: Iterable[str], sites: Sites, source: str = "declared") -> list[Candidate]:
    """All candidates of the effects that a campaign declares.

    `source`: named in errors. Raises `InputError`: an effect that the catalogue does not have.
    """
    for name in names:
        if name not in effects():
            raise InputError(source, "declared", repr(name), ", ".join(effects()))
    return [candidate for name in names for candidate in effects()[name].candidates(sites)]
