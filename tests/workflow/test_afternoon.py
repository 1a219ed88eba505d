"""README's way from a URDF to a corrected robot is the script that CI runs."""

import re
from pathlib import Path

from elastocal.command.main import app

ROOT = Path(__file__).resolve().parents[2]
SECTION = "## From a robot and a tracker to a corrected robot"


def commands(text):
    """Subcommands in their order, with the option names of each."""
    joined = re.sub(r"\\\n\s*", " ", text)
    lines = [line.split("#")[0].strip() for line in joined.splitlines()]
    return [line.split()[1:] for line in lines if line.startswith("elastocal ")]


def named(words):
    return " ".join(words[:2]) if words[0] == "import" else words[0]


def test_each_command_of_the_readme_is_run_by_the_script():
    readme = (ROOT / "README.md").read_text(encoding="utf-8").split(SECTION)[1].split("\n## ")[0]
    script = (ROOT / "workflow" / "examples" / "afternoon.sh").read_text(encoding="utf-8")
    shown, run = commands(readme), commands(script)
    assert {named(words) for words in shown} == {named(words) for words in run}
    # A plan before a diagnosis, a diagnosis before what is made of it.
    order = [named(words) for words in run]
    assert order.index("plan") < order.index("check") < order.index("diagnose") < order.index("correct")
    known = {command.callback.__name__ for command in app.registered_commands}
    assert {name for name in map(named, shown) if " " not in name} <= known


def test_options_of_the_readme_are_those_of_the_script():
    """What the script adds is for the stand-in; what README shows is nowhere made up."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8").split(SECTION)[1].split("\n## ")[0]
    script = (ROOT / "workflow" / "examples" / "afternoon.sh").read_text(encoding="utf-8")
    used = {named(words): set() for words in commands(script)}
    for words in commands(script):
        used[named(words)] |= {word for word in words if word.startswith("--")}
    for words in commands(readme):
        assert {word for word in words if word.startswith("--")} <= used[named(words)], words
