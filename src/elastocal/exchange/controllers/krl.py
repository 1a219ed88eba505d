"""KUKA Robot Language: PTP to axis positions in degrees and mm.

After KUKA System Software 8.3, Operating and Programming Instructions for System Integrators, KUKA Roboter GmbH.
"""

from collections.abc import Sequence

from elastocal.exchange.controllers.protocol import JointTargets, remarks

NAME, WORDS, SUFFIX = "krl", "KUKA KRL", ".src"
AXES, EXTERNAL = tuple(f"A{axis}" for axis in range(1, 7)), tuple(f"E{axis}" for axis in range(1, 7))
PROGRAM = r"[A-Za-z_]\w{0,23}", "up to 24 letters, digits and underscores that begin with no digit, and no word of the language"
RESERVED = (
    "and anin anout axis b_and b_exor b_not b_or base bas bool brake cast_from cast_to case ccirc char circ circ_rel "
    "confirm const continue decl def default defdat deffct do e6axis e6pos else end enddat endfct endfor endif endloop "
    "endswitch endwhile enum exit exor ext extfct false for frame global goto halt i if import int interrupt is lin lin_rel "
    "loop not off on or pos private ptp ptp_rel public pulse real repeat resume return sec signal spl spline step struc "
    "switch then to trigger true until wait when while"
)


def program(name: str, targets: JointTargets, notes: Sequence[str] = ()) -> str:
    """A module whose only routine goes to all targets, slowly."""
    lines = ["&ACCESS RVP", f"DEF {name}()", "  ; joint targets corrected by elastocal, degrees and mm"]
    # A comment that began with FOLD would fold the lines behind it.
    lines += [
        *remarks(notes, "  ; - "),
        "  INT i",
        "  BAS(#INITMOV, 0)",
        "  FOR i = 1 TO 6",
        "    $VEL_AXIS[i] = 10",
        "  ENDFOR",
    ]
    for row in targets.rows(targets.axes):
        lines.append(f"  PTP {{E6AXIS: {', '.join(f'{axis} {value}' for axis, value in zip(targets.axes, row, strict=True))}}}")
    return "\n".join([*lines, "END", ""])
