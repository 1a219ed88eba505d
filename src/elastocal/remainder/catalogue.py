"""All regressions that are there: each module of this package that has a NAME."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, cast

import elastocal.remainder
from elastocal.io.modules import modules_with

if TYPE_CHECKING:
    from elastocal.remainder.protocol import Regression


@cache
def regressions() -> dict[str, Regression]:
    """Modules of the catalogue by the name of their regression."""
    return {module.NAME: cast("Regression", module) for module in modules_with("NAME", elastocal.remainder).values()}
