"""Universal Robots URScript: movej to joint positions in rad.

After Universal Robots, The URScript Programming Language for e-Series (movej; identifiers, keywords).
"""

from collections.abc import Sequence

import numpy as np

from elastocal.exchange.controllers.protocol import JointTargets, remarks

NAME, WORDS, SUFFIX = "urscript", "URScript", ".script"
AXES, EXTERNAL = ("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3"), ()
PROGRAM = r"[A-Za-z_]\w*", "letters, digits and underscores that begin with no digit, and no word of the language"
RESERVED = (
    "and break continue def elif else end enter_critical exit_critical false for global halt if join kill local not or pass "
    "return run sec thread true while xor movej movel movec movep servoj speedj stopj sleep sync textmsg"
)


def program(name: str, targets: JointTargets, notes: Sequence[str] = ()) -> str:
    """A program that goes to all targets, slowly."""
    order = [targets.axes.index(axis) for axis in AXES]
    lines = [f"def {name}():", "  # joint targets corrected by elastocal, rad", *remarks(notes, "  # ")]
    for row in np.radians(targets.values[:, order]):
        lines.append(f"  movej([{', '.join(f'{round(value, 9) + 0.0:.9f}' for value in row)}], a=0.5, v=0.2)")
    return "\n".join([*lines, "end", ""])
