"""All effects that a model may lack: those of the modules of this package, and those
that other installed packages offer by an entry point (see `io.plugins`)."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import elastocal.effects
from elastocal.effects.protocol import Effect, require_unique
from elastocal.errors import InputError
from elastocal.io import plugins
from elastocal.io.modules import list_entries

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.effects.protocol import Candidate
    from elastocal.mechanics.sites import Sites


@cache
def list_effects() -> dict[str, Effect]:
    """Effects of this package and of plug-ins, by name, sorted.

    Raises `InputError`, which names the package: a plug-in cannot be loaded.
    """
    bundled = list_bundled_effects()
    offered = plugins.load_plugins(plugins.EFFECTS, Effect, bundled)
    return dict(sorted((bundled | offered).items()))


@cache
def list_bundled_effects() -> dict[str, Effect]:
    """Effects of the modules of this package, by name, sorted."""
    effects = list_entries(elastocal.effects, Effect)
    require_unique([effect.name for effect in effects])
    return dict(sorted((effect.name, effect) for effect in effects))


def candidates_on(sites: Sites) -> dict[str, Candidate]:
    """List every way in which an effect of the catalogue can act on a robot, by key.

    On a base that moves, the direction of gravity is unknown: no effect of it is listed.
    """
    candidates = [
        candidate
        for effect in list_effects().values()
        if not (sites.base_moves and effect.family == "gravity")
        for candidate in effect.candidates(sites)
    ]
    require_unique([candidate.key for candidate in candidates])
    return {candidate.key: candidate for candidate in candidates}


def moves_robot(candidate: Candidate) -> bool:
    """Decide whether a candidate moves the robot, so that its tasks feel it.

    Joint compliances and errors of declared masses, which are not effects of the
    catalogue, move the robot too.
    """
    if candidate.of_setup:
        return False
    effect = list_effects().get(candidate.effect)
    return effect is None or effect.moves_robot


def declared_candidates(
    names: Iterable[str], sites: Sites, source: str = "declared"
) -> list[Candidate]:
    """List all candidates of the effects that a campaign declares.

    Raises `InputError`, which names `source`: there is no effect of this name.
    """
    effects = list_effects()
    candidates = []
    for name in names:
        if name not in effects:
            raise InputError(source, "declared", repr(name), ", ".join(effects))
        candidates += effects[name].candidates(sites)
    return candidates
