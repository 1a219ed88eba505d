"""How far the robot is off before and after its correction: one table, the same in report, certificate and on the terminal.

What is measured and what is predicted, over which poses and in which frame, are different errors; each row says which it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.application.accuracy import accuracy_from, millimetres
from elastocal.application.frames import FRAMES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.application.accuracy import Accuracy

_MEASURED = "measured at validation poses, noise included, after the best placement of the base"


def error_rows(verdict: Mapping[str, Any], *others: tuple[Accuracy, float]) -> list[list[str]]:
    """Which RMS error, of the uncorrected robot, of the corrected one; no row where the data are at fault.

    `verdict`: contents of verdict.json. `others`: accuracies over other poses, each with that of the uncorrected robot, m.
    """
    if not verdict.get("accuracy"):
        return []
    heldout = verdict["heldout"]
    stated = [(accuracy_from(verdict["accuracy"]), verdict["uncorrected_m"]), *others]
    return [
        [_MEASURED, millimetres(heldout["uncalibrated"]["rms_m"]), millimetres(heldout["delivered"]["rms_m"])],
        *(
            [f"{each.kind} over {each.region}, {FRAMES[each.frame]}", millimetres(before), millimetres(each.rms_m)]
            for each, before in stated
        ),
    ]


def error_lines(verdict: Mapping[str, Any], *others: tuple[Accuracy, float]) -> list[str]:
    """The table for a terminal, a line a row."""
    return [f"{where}: {before} uncorrected, {after} corrected" for where, before, after in error_rows(verdict, *others)]
