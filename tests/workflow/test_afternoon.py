"""README's way from a URDF to a corrected robot is a script that runs, and the
demonstration goes it by itself."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from study_folder import Study

ROOT = Path(__file__).resolve().parents[2]
SECTION = "## From a robot and a tracker to a corrected robot"


def commands(text):
    """Subcommands in their order, with the option names of each."""
    joined = re.sub(r"\\\n\s*", " ", text)
    lines = [line.split("#")[0].strip() for line in joined.splitlines()]
    return [line.split()[1:] for line in lines if line.startswith("elastocal ")]


def named(words):
    return " ".join(words[:2]) if words[0] == "import" else words[0]


def test_each_command_and_option_of_the_readme_is_one_of_the_script():
    """What the script adds is for the stand-in; what README shows is nowhere made
    up."""
    readme = (
        (ROOT / "README.md")
        .read_text(encoding="utf-8")
        .split(SECTION)[1]
        .split("\n## ")[0]
    )
    script = (ROOT / "workflow" / "examples" / "afternoon.sh").read_text(
        encoding="utf-8"
    )
    shown = commands(readme)
    run = commands(script)
    assert {named(arguments) for arguments in shown} == {
        named(arguments) for arguments in run
    }
    # A plan before a diagnosis, a diagnosis before what is made of it.
    order = [named(arguments) for arguments in run]
    assert (
        order.index("plan")
        < order.index("check")
        < order.index("diagnose")
        < order.index("correct")
    )
    used = {named(arguments): set() for arguments in run}
    for arguments in run:
        used[named(arguments)] |= {
            argument for argument in arguments if argument.startswith("--")
        }
    for arguments in shown:
        assert {
            argument for argument in arguments if argument.startswith("--")
        } <= used[named(arguments)], arguments


# What docs/closed_loop.md holds the corrected robot to, of what noise and repeatability
# leave.
OVER_FLOOR = 1.2
WAYS = {
    "demo": ("elastocal", "demo", "campaigns/demo"),
    "kr16": ("workflow/examples/afternoon.sh", "campaigns/kr16"),
}


@pytest.mark.slow
@pytest.mark.parametrize("campaign", WAYS)
def test_the_whole_way_ends_with_a_certificate_and_a_robot_that_is_as_near_as_noise_allows(
    campaign, tmp_path
):
    Study.of_links(tmp_path)
    binaries = Path(sys.executable).parent
    (tmp_path / ".venv").symlink_to(binaries.parent)
    environment = os.environ | {
        "PATH": f"{binaries}:{os.environ['PATH']}",
        "OMP_NUM_THREADS": "1",
    }
    done = subprocess.run(
        WAYS[campaign], cwd=tmp_path, capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    reports = tmp_path / "reports" / "loop" / campaign
    assert all(
        (reports / name).stat().st_size
        for name in ("report.pdf", "certificate.pdf", "verification.pdf")
    )
    assert json.loads((reports / "verdict.json").read_text(encoding="utf-8"))["effects"]
    if campaign == "kr16":
        missed = re.findall(
            r"^(\w+) .*position error: RMS ([\d.]+) mm,", done.stdout, re.MULTILINE
        )
        rms = {name: float(value) for name, value in missed}
        assert (
            rms["uncorrected"] > 5 * rms["noise"]
            and rms["corrected"] < OVER_FLOOR * rms["noise"]
        )
