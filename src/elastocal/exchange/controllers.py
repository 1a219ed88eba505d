"""Programs with joint targets in the languages of robot controllers; `CONTROLLERS` has one
entry for each language.

Each program moves slowly to all targets. References: KUKA System Software 8.3, Operating and
Programming Instructions for System Integrators (PTP to axis positions); ABB, Technical
reference manual: RAPID Instructions, 3HAC050917 (MoveAbsJ, jointtarget); FANUC, R-30iB
Plus Operator's Manual, B-83284EN (joint positions, ASCII upload); Universal Robots, The
URScript Programming Language for e-Series (movej).
"""

import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from elastocal.counting import format_count
from elastocal.errors import InputError, format_printable
from elastocal.io import plugins


@dataclass(frozen=True)
class JointTargets:
    """Joint targets in the units of controllers.

    Attributes
    ----------
    axes : the controller's names of the joints.
    units : unit of each joint, "deg" or "mm".
    values : targets, (N, n), in deg, and in mm for prismatic joints.
    """

    axes: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray

    def rows(self, names: Sequence[str]) -> list[list[str | None]]:
        """Format the numbers of these axes, target by target; None for an axis that the
        robot does not have."""
        rows = []
        for values in self.values:
            # Adding zero removes the minus sign of a zero.
            texts = [f"{round(value, 6) + 0.0:.6f}" for value in values]
            text_by_axis = dict(zip(self.axes, texts, strict=True))
            rows.append([text_by_axis.get(name) for name in names])
        return rows


@dataclass(frozen=True)
class Controller:
    """The language of a robot controller.

    Attributes
    ----------
    name : name in options.
    words : name in sentences.
    suffix : suffix of its files.
    axes : its names of the robot's axes.
    external : its names of external axes.
    pattern, pattern_words : regular expression of the names of programs, and the same in
        words.
    write : makes the lines of a program from its name, targets and notes, which
        `format_remarks` turns into comments.
    """

    name: str
    words: str
    suffix: str
    axes: tuple[str, ...]
    external: tuple[str, ...]
    pattern: str
    pattern_words: str
    write: Callable[[str, JointTargets, Sequence[str]], list[str]]

    def program(
        self, name: str, targets: JointTargets, notes: Sequence[str] = ()
    ) -> str:
        """Format the text of a file; `check_name` has checked the name."""
        return "\n".join([*self.write(name, targets, notes), ""])


def format_remarks(
    notes: Sequence[str], mark: str, longest: int = 100, end: str = ""
) -> list[str]:
    """Format notes as lines of comments, each after the language's mark.

    Only characters that no controller reads as syntax are kept: letters and digits of
    ASCII, blanks and ``. , : _ + - / ( )``. All others become question marks.
    """
    lines = []
    for note in notes:
        plain = re.sub(r"[^A-Za-z0-9 .,:_+\-/()]", "?", format_printable(note))
        lines += [f"{mark}{text}{end}" for text in textwrap.wrap(plain, longest)]
    return lines


def _krl(name: str, targets: JointTargets, notes: Sequence[str]) -> list[str]:
    # A comment that began with FOLD would fold the lines behind it.
    lines = [
        "&ACCESS RVP",
        f"DEF {name}()",
        "  ; joint targets corrected by elastocal, degrees and mm",
        *format_remarks(notes, "  ; - "),
    ]
    lines += [
        "  INT i",
        "  BAS(#INITMOV, 0)",
        "  FOR i = 1 TO 6",
        "    $VEL_AXIS[i] = 10",
        "  ENDFOR",
    ]
    for row in targets.rows(targets.axes):
        pairs = zip(targets.axes, row, strict=True)
        position = ", ".join(f"{axis} {value}" for axis, value in pairs)
        lines.append(f"  PTP {{E6AXIS: {position}}}")
    return [*lines, "END"]


def _rapid(name: str, targets: JointTargets, notes: Sequence[str]) -> list[str]:
    """A module with the targets, and a procedure that moves to all of them with the tool
    of the caller."""
    rows = targets.rows((*_RAPID_AXES, *_RAPID_EXTERNAL))
    lines = [
        f"MODULE {name}",
        "  ! joint targets corrected by elastocal, degrees and mm",
        *format_remarks(notes, "  ! "),
    ]
    for number, row in enumerate(rows, 1):
        axes = ",".join(value or "0" for value in row[:6])
        external = ",".join(value or "9E9" for value in row[6:])
        lines.append(f"  CONST jointtarget target_{number} := [[{axes}],[{external}]];")
    lines += ["", "  PROC go_to_targets(PERS tooldata used_tool)"]
    lines += [
        f"    MoveAbsJ target_{number}, v100, fine, used_tool;"
        for number in range(1, len(rows) + 1)
    ]
    return [*lines, "  ENDPROC", "ENDMODULE"]


def _tp(name: str, targets: JointTargets, notes: Sequence[str]) -> list[str]:
    """A program of group 1, which includes extended axes, with three axes on a line and
    remarks of 32 characters."""
    names = [axis for axis in (*_TP_AXES, *_TP_EXTERNAL) if axis in targets.axes]
    units = dict(zip(targets.axes, targets.units, strict=True))
    rows = targets.rows(names)
    lines = [
        f"/PROG  {name.upper()}",
        "/ATTR",
        'COMMENT\t\t= "elastocal";',
        "DEFAULT_GROUP\t= 1,*,*,*,*;",
        "/MN",
    ]
    instructions = [
        *format_remarks(notes, "  !", 32, " ;"),
        *(f"J P[{number}] 10% FINE    ;" for number in range(1, len(rows) + 1)),
    ]
    lines += [
        *(
            f"{number:4d}:{instruction}"
            for number, instruction in enumerate(instructions, 1)
        ),
        "/POS",
    ]
    for number, row in enumerate(rows, 1):
        positions = [
            f"{axis}= {value} {units[axis]}"
            for axis, value in zip(names, row, strict=True)
        ]
        position_lines = [
            ",\t".join(positions[first : first + 3])
            for first in range(0, len(positions), 3)
        ]
        lines += [
            f"P[{number}]{{",
            "   GP1:",
            "\tUF : 0, UT : 1,\t",
            "\t" + ",\n\t".join(position_lines),
            "};",
        ]
    return [*lines, "/END"]


def _urscript(name: str, targets: JointTargets, notes: Sequence[str]) -> list[str]:
    order = [targets.axes.index(axis) for axis in _UR_AXES]
    lines = [
        f"def {name}():",
        "  # joint targets corrected by elastocal, rad",
        *format_remarks(notes, "  # "),
    ]
    for row in np.radians(targets.values[:, order]):
        position = ", ".join(f"{round(value, 9) + 0.0:.9f}" for value in row)
        lines.append(f"  movej([{position}], a=0.5, v=0.2)")
    return [*lines, "end"]


_RAPID_AXES = tuple(f"rax_{axis}" for axis in range(1, 7))
_RAPID_EXTERNAL = tuple(f"eax_{axis}" for axis in "abcdef")
_TP_AXES = tuple(f"J{axis}" for axis in range(1, 7))
_TP_EXTERNAL = tuple(f"E{axis}" for axis in range(1, 4))
_UR_AXES = ("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3")
_NAMED = "letters, digits and underscores that begin with"
_CONTROLLERS = (
    Controller(
        name="krl",
        words="KUKA KRL",
        suffix=".src",
        axes=tuple(f"A{axis}" for axis in range(1, 7)),
        external=tuple(f"E{axis}" for axis in range(1, 7)),
        pattern=r"[A-Za-z_]\w{0,23}",
        pattern_words=f"up to 24 {_NAMED} no digit",
        write=_krl,
    ),
    Controller(
        name="rapid",
        words="ABB RAPID",
        suffix=".mod",
        axes=_RAPID_AXES,
        external=_RAPID_EXTERNAL,
        pattern=r"(?!(?i:target_\d+)$)[A-Za-z]\w{0,31}",
        pattern_words=f"up to 32 {_NAMED} a letter",
        write=_rapid,
    ),
    Controller(
        name="tp",
        words="FANUC TP",
        suffix=".ls",
        axes=_TP_AXES,
        external=_TP_EXTERNAL,
        pattern=r"[A-Za-z]\w{0,35}",
        pattern_words=f"up to 36 {_NAMED} a letter",
        write=_tp,
    ),
    Controller(
        name="urscript",
        words="URScript",
        suffix=".script",
        axes=_UR_AXES,
        external=(),
        pattern=r"[A-Za-z_]\w*",
        pattern_words=f"{_NAMED} no digit",
        write=_urscript,
    ),
)
CONTROLLERS = {controller.name: controller for controller in _CONTROLLERS}


def list_controllers() -> dict[str, Controller]:
    """List the languages of this package and of other installed packages, by name."""
    return CONTROLLERS | plugins.load_plugins(
        plugins.CONTROLLERS, Controller, CONTROLLERS
    )


def find_controller(name: str) -> Controller:
    """Find a language by its name; raises `InputError` if there is none."""
    if name in CONTROLLERS:
        return CONTROLLERS[name]
    controllers = list_controllers()
    if name not in controllers:
        raise InputError("--format", "", repr(name), " | ".join(controllers))
    return controllers[name]


def check_name(controller: Controller, path: Path) -> str:
    """Return the name of a program, which is that of its file without the suffix; refuse
    one that the language does not allow."""
    name = path.stem
    if not re.fullmatch(controller.pattern, name, re.ASCII):
        raise InputError(
            path,
            "--output",
            f"{name!r} as the name of a program",
            f"in {controller.words}: {controller.pattern_words}",
        )
    return name


def find_axes(
    controller: Controller, prismatic: Sequence[bool], stated: str
) -> tuple[str, ...]:
    """Find the controller's names of q1, q2, ...

    Six revolute joints are the robot's axes in their order, and prismatic joints are
    external axes. For other robots the names must be `stated`, as ``A1,A2,...``: the
    third of seven joints may be an external axis, and a palletizer has four of six.
    """
    all_axes = (*controller.axes, *controller.external)
    joints = f"q1 to q{len(prismatic)}"
    if stated:
        names = tuple(name.strip() for name in stated.split(","))
        is_complete = len(names) == len(set(names)) == len(prismatic)
        if not is_complete or not set(names) <= set(all_axes):
            count = format_count(len(prismatic), "different name")
            raise InputError(
                "--axes",
                "",
                repr(stated),
                f"{count}, of {joints}, of {', '.join(all_axes)}",
            )
        return names
    shifts = sum(prismatic)
    turns = len(prismatic) - shifts
    if turns != len(controller.axes) or shifts > len(controller.external):
        problem = f"{_count_revolute(turns)} and {shifts} that shift"
        if controller.external:
            allowed = (
                f"--axes with what {controller.words} calls each of {joints}:"
                f" {', '.join(all_axes)}"
            )
        else:
            count = _count_revolute(len(controller.axes))
            allowed = f"{count}, which is all that {controller.words} has"
        raise InputError("--format", controller.name, problem, allowed)
    robot_axes = iter(controller.axes)
    external_axes = iter(controller.external)
    return tuple(
        next(external_axes if is_prismatic else robot_axes)
        for is_prismatic in prismatic
    )


def _count_revolute(count: int) -> str:
    return format_count(count, "joint that turns", "joints that turn")


def build_targets(
    joint_angles: np.ndarray, prismatic: Sequence[bool], axes: tuple[str, ...]
) -> JointTargets:
    """Make targets of joint angles (N, n) in rad, and in m for prismatic joints."""
    values = np.where(prismatic, 1e3 * joint_angles, np.degrees(joint_angles))
    units = tuple("mm" if is_prismatic else "deg" for is_prismatic in prismatic)
    return JointTargets(axes, units, values)
