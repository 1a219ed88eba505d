"""FANUC TP as ASCII (.LS): J motions to joint positions in degrees and mm.

After FANUC, R-30iB Plus Operator's Manual (Basic Operation), B-83284EN (program names, joint positions, ASCII upload).
"""

from collections.abc import Sequence

from elastocal.exchange.controllers.protocol import JointTargets, remarks

NAME, WORDS, SUFFIX = "tp", "FANUC TP", ".ls"
AXES, EXTERNAL = tuple(f"J{axis}" for axis in range(1, 7)), tuple(f"E{axis}" for axis in range(1, 4))
PROGRAM = r"[A-Za-z]\w{0,35}", "up to 36 letters, digits and underscores that begin with a letter, and no device"
RESERVED = "con prn aux nul com1 com2 com3 com4 com5 com6 com7 com8 com9 lpt1 lpt2 lpt3"
_A_LINE = 3
# Characters of a remark.
_REMARK = 32


def program(name: str, targets: JointTargets, notes: Sequence[str] = ()) -> str:
    """A program that goes to all positions of group 1, slowly; extended axes are of that group."""
    names = [axis for axis in (*AXES, *EXTERNAL) if axis in targets.axes]
    units = dict(zip(targets.axes, targets.units, strict=True))
    rows = targets.rows(names)
    lines = [f"/PROG  {name.upper()}", "/ATTR", 'COMMENT\t\t= "elastocal";', "DEFAULT_GROUP\t= 1,*,*,*,*;", "/MN"]
    inside = [*remarks(notes, "  !", _REMARK, " ;"), *(f"J P[{number}] 10% FINE    ;" for number in range(1, len(rows) + 1))]
    lines += [f"{number:4d}:{instruction}" for number, instruction in enumerate(inside, 1)]
    lines.append("/POS")
    for number, row in enumerate(rows, 1):
        words = [f"{axis}= {value} {units[axis]}" for axis, value in zip(names, row, strict=True)]
        inside = [",\t".join(words[first : first + _A_LINE]) for first in range(0, len(words), _A_LINE)]
        lines += [f"P[{number}]{{", "   GP1:", "\tUF : 0, UT : 1,\t", "\t" + ",\n\t".join(inside), "};"]
    return "\n".join([*lines, "/END", ""])
