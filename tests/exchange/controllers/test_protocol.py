"""Names of programs and of axes: what a language does not have is refused, and what is not plain is asked for."""

import re
from pathlib import Path

import pytest
from made_targets import made_targets
from support import refused

from elastocal.exchange.controllers.catalogue import controllers
from elastocal.exchange.controllers.protocol import axes_of, check_name

ALL = controllers()
SIX = (False,) * 6


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("stem", ["1st", "my targets", "größe", "a-b", "", "x" * 40])
def test_a_name_that_no_program_may_have_is_refused(name, stem):
    if name == "urscript" and stem.startswith("x"):
        return
    path = Path(f"{stem}{ALL[name].SUFFIX}") if stem else Path("folder") / ALL[name].SUFFIX
    with refused(path, "name of a program", ALL[name].WORDS):
        check_name(ALL[name], path)


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("krl", "PTP"),
        ("krl", "i"),
        ("rapid", "Module"),
        ("rapid", "target_3"),
        ("rapid", "TARGET_3"),
        ("tp", "con"),
        ("urscript", "while"),
    ],
)
def test_a_word_of_the_language_is_no_name(name, stem):
    with refused(stem, "name of a program", "no "):
        check_name(ALL[name], Path(stem + ALL[name].SUFFIX))


@pytest.mark.parametrize("name", ALL)
def test_a_plain_name_is_kept(name):
    assert check_name(ALL[name], Path("out/targets_2.any")) == "targets_2"


def test_six_joints_that_turn_are_plain_and_a_rail_is_an_external_axis():
    assert axes_of(ALL["krl"], SIX, "") == ("A1", "A2", "A3", "A4", "A5", "A6")
    assert axes_of(ALL["krl"], (True, *SIX), "") == ("E1", "A1", "A2", "A3", "A4", "A5", "A6")
    assert axes_of(ALL["rapid"], (True, True, *SIX), "")[:3] == ("eax_a", "eax_b", "rax_1")
    assert axes_of(ALL["tp"], (*SIX, True), "")[-2:] == ("J6", "E1")


@pytest.mark.parametrize("prismatic", [(False,) * 7, (False,) * 4, (False, False, True, False), (True,) + (False,) * 5])
def test_other_robots_axes_are_asked_for(prismatic):
    with refused("--format", "joints that turn", "--axes", "A1", "E1"):
        axes_of(ALL["krl"], prismatic, "")
    with refused("--format", "joints that turn", "6 joints", "URScript"):
        axes_of(ALL["urscript"], prismatic, "")


def test_axes_are_as_stated_and_each_once():
    stated = ("A1", "A2", "E1", "A3", "A4", "A5", "A6")
    assert axes_of(ALL["krl"], (False,) * 7, ", ".join(stated)) == stated
    for wrong in ("A1,A2", "A1,A1,A2,A3,A4,A5,A6", "J1,A2,E1,A3,A4,A5,A6"):
        with refused("--axes", wrong, "7 different names"):
            axes_of(ALL["krl"], (False,) * 7, wrong)


@pytest.mark.parametrize("name", ALL)
def test_no_note_adds_a_statement_to_a_program(name):
    """Quotes, ends of lines and of statements, and signs of comments: the program without its remarks is that without notes."""
    evil = [
        "robot: x\nPTP {A1 0}\rMoveAbsJ target_1; 99:J P[1] 100% FINE ;",
        'tool: "\u2028END\x85ENDFOLD" */ movej([0,0]) \x1b[2J; /END',
        "größe ! # ; " + "long " * 60,
    ]
    with_notes, without = (ALL[name].program("go", made_targets(ALL[name]), notes) for notes in (evil, ()))
    remark = {"krl": r" +; - .*", "rapid": r" +! .*", "tp": r" *\d+:  !.{1,32} ;", "urscript": r" +# .*"}[name]
    kept = [line for line in with_notes.split("\n") if not re.fullmatch(remark, line, re.ASCII)]
    plain = [line for line in without.split("\n") if not re.fullmatch(remark, line, re.ASCII)]
    numbers = r"^ *\d+:"
    assert [re.sub(numbers, "", line) for line in kept] == [re.sub(numbers, "", line) for line in plain]
    assert with_notes.isascii() and len(with_notes.splitlines()) == len(with_notes.split("\n")) - 1
    for line in set(with_notes.split("\n")) - set(kept):
        assert not set(line.split(":  !")[-1].removesuffix(" ;").replace(";", "", 1)) & set("\"'[]{};*=\\")
