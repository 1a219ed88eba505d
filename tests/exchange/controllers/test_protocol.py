"""Names of programs and of axes: what a language does not have is refused, and what is not plain is asked for."""

from pathlib import Path

import pytest
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
