"""ABB RAPID: MoveAbsJ to jointtargets in degrees and mm.

After ABB, Technical reference manual: RAPID Instructions, Functions and Data types, 3HAC050917 (MoveAbsJ, jointtarget), and
RAPID Overview, 3HAC050947 (identifiers, reserved words).
"""

from collections.abc import Sequence

from elastocal.exchange.controllers.protocol import JointTargets, remarks

NAME, WORDS, SUFFIX = "rapid", "ABB RAPID", ".mod"
AXES, EXTERNAL = tuple(f"rax_{axis}" for axis in range(1, 7)), tuple(f"eax_{axis}" for axis in "abcdef")
PROGRAM = (
    r"(?!(?i:target_\d+)$)[A-Za-z]\w{0,31}",
    "up to 32 letters, digits and underscores that begin with a letter, and no word of the language",
)
RESERVED = (
    "alias and backward case connect const default div do else elseif endfor endfunc endif endmodule endproc endrecord "
    "endtest endtrap endwhile error exit false for from func goto if inout local mod module nostepin not noview or pers "
    "proc raise readonly record retry return step sysmodule test then to trap true trynext undo var viewonly while with xor "
    "go_to_targets used_tool main robtarget jointtarget tooldata base user"
)
# Of an external axis that is not there, and of an axis of the robot that is not.
_NONE, _STILL = "9E9", "0"


def program(name: str, targets: JointTargets, notes: Sequence[str] = ()) -> str:
    """A module with the targets, and a procedure that goes to all of them with a tool of the caller's."""
    rows = targets.rows((*AXES, *EXTERNAL))
    lines = [f"MODULE {name}", "  ! joint targets corrected by elastocal, degrees and mm", *remarks(notes, "  ! ")]
    for number, row in enumerate(rows, 1):
        own = ",".join(value or _STILL for value in row[: len(AXES)])
        beside = ",".join(value or _NONE for value in row[len(AXES) :])
        lines.append(f"  CONST jointtarget target_{number} := [[{own}],[{beside}]];")
    lines += ["", "  PROC go_to_targets(PERS tooldata used_tool)"]
    lines += [f"    MoveAbsJ target_{number}, v100, fine, used_tool;" for number in range(1, len(rows) + 1)]
    return "\n".join([*lines, "  ENDPROC", "ENDMODULE", ""])
