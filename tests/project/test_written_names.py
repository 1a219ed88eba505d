"""A foreign folder overwrites nothing: at every name that a command writes, links,
pipes, devices and folders are refused."""

import os
import runpy
import shutil
import socket
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from analysed_robots import ROBOTS, analysed
from made_urdf import joint, link, written
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from elastocal.application import exported
from elastocal.application.calibrated import compute_nominal_poses
from elastocal.command.main import app
from elastocal.errors import InputError
from elastocal.figures import style
from elastocal.io import atomic_writes, json_files
from elastocal.io.replacement import WRITTEN_FILES
from elastocal.report import typesetting

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).resolve().parents[2] / "workflow" / "examples"
PLAN = ("plan", "arm.yaml", "--candidates", "60", "--poses", "18", "--held-out", "4")
CSV = (
    "import",
    "csv",
    "t.csv",
    "--angles",
    "deg",
    "--lengths",
    "mm",
    "--target",
    "smr",
    "--folder",
)
CERTIFICATE = ("certificate", "made", "--tolerance", "0.5mm")
# What each is called with, and the folder in which it writes; all names are relative to
# a checkout with a diagnosed campaign.
IMPORTED = (
    "import",
    "urdf",
    "arm.urdf",
    "--base",
    "base",
    "--tip",
    "hand",
    "-o",
    "out/arm.yaml",
)
COMMANDS = {
    "init": (("init", "out", "--robot", "arm.yaml"), "out"),
    "import urdf": ((*IMPORTED, "--force"), "out"),
    "import dh": (("import", "dh", "arm.csv", "-o", "out/arm.yaml", "--force"), "out"),
    "import csv": ((*CSV, "out", "--force"), "out"),
    "plan": ((*PLAN, "--folder", "out/cell"), "out"),
    "correct": (("correct", "made", "path.csv", "--output", "out/targets.csv"), "out"),
    "export": (("export", "made", "--output", "out"), "out"),
    "certificate": (CERTIFICATE, "reports/loop/made"),
    "simulate_measurements.py": (
        ("simulate_measurements.py", "simulated", "simulated/robot.yaml"),
        "simulated",
    ),
    "rehearse.py measure": (("rehearse.py", "measure", "planned"), "planned"),
    "rehearse.py path": (("rehearse.py", "path", "planned", "out/path.csv"), "out"),
}
KINDS = (
    "link",
    "dangling link",
    "link to a folder",
    "pipe",
    "socket",
    "device",
    "folder",
)
# Folders that are new as a whole: their own name is what is written, and nothing below
# it.
WHOLE = {"plan": "cell"}


@pytest.fixture(scope="module")
def checkout(checkout):
    """A checkout with what the commands read: a diagnosed campaign, a planned one, one
    to fill, robots and tables."""
    top = checkout
    (top / "out").mkdir()
    shutil.copy(ROBOTS / "ur10.yaml", top / "arm.yaml")
    (top / "arm.csv").write_text("d_m,a_m,alpha_deg\n0.1,0.4,90\n")
    arm = (
        link("base"),
        link("arm", 2.0),
        link("hand"),
        joint("j1", "base", "arm", xyz=(0, 0, 0.5)),
        joint("j2", "arm", "hand"),
    )
    written(top, *arm).rename(top / "arm.urdf")
    (top / "t.csv").write_text("J1;X;Y;Z\n90;1000,5;2;3\n-90;1000;2;3\n")
    robot = analysed("kuka")
    angles = (
        robot.joint_limits.mean(axis=1)
        + [0.0, 0.2, 0.1, 0.3, 0.7, 0.0]
        + 0.2 * np.linspace(0, 1, 8)[:, None]
    )
    position, rotation = compute_nominal_poses(robot, angles)
    pose = np.column_stack([position, Rotation.from_matrix(rotation).as_rotvec()])
    pd.DataFrame(pose, columns=["x", "y", "z", "rx", "ry", "rz"]).to_csv(
        top / "path.csv", index=False
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(top)
        assert (
            run(
                *PLAN,
                "--folder",
                "planned",
                "--base-known",
                "--measured",
                "pose",
                "--force",
                "80",
                "--pull",
            )
            is None
        )
        assert run("init", "simulated", "--robot", "arm.yaml") is None
        document = yaml.safe_load(Path("simulated/campaign.yaml").read_text()) | {
            "measured": "pose",
            "frame": "base",
        }
        document["targets"]["reflector"]["offset_m"] = [0, 0, 0]
        Path("simulated/campaign.yaml").write_text(yaml.safe_dump(document))
    return top


def run(*words):
    """What stopped a command or a script: None where it ended well, or with the exit
    code of a decision."""
    if not words[0].endswith(".py"):
        result = CliRunner().invoke(app, words)
        return (
            None
            if isinstance(result.exception, SystemExit | None)
            and result.exit_code in (0, 1)
            else result.exception
        )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [str(EXAMPLES / words[0]), *words[1:]])
        try:
            runpy.run_path(str(EXAMPLES / words[0]), run_name="__main__")
        except SystemExit as stopped:
            return stopped.code
    return None


def listed(top):
    """Name, kind and contents of all that is there."""

    def contents(path):
        return (
            os.readlink(path)
            if path.is_symlink()
            else path.read_bytes()
            if path.is_file()
            else None
        )

    return {
        path.relative_to(top).as_posix(): (path.lstat().st_mode, contents(path))
        for path in sorted(top.rglob("*"))
    }


def plant(path, kind, victim):
    if path.is_file() or path.is_symlink():
        path.unlink()
    if "link" in kind:
        ends = {
            "link": victim,
            "dangling link": victim.with_name("none"),
            "link to a folder": victim.parent,
        }
        path.symlink_to(ends[kind])
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(os.path.relpath(path))
    elif kind == "device":
        os.mknod(path, 0o666 | 0o020000, os.makedev(1, 7))
    else:
        (os.mkfifo if kind == "pipe" else os.mkdir)(path)


@pytest.fixture(scope="module")
def names_written(checkout, tmp_path_factory):
    """The names that a command writes in a clean folder."""

    @cache
    def names_of(command):
        arguments, output = COMMANDS[command]
        top = shutil.copytree(
            checkout, tmp_path_factory.mktemp("clean") / "top", symlinks=True
        )
        before = listed(top)
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(top)
            assert run(*arguments) is None
        after = listed(top)
        names = [
            name
            for name in after
            if after[name] != before.get(name) and (top / name).is_file()
        ]
        # What a command has written is noted in a list, see `io.replacement`.
        allowed = (Path(output), WRITTEN_FILES)
        assert names
        for name in names:
            assert any(Path(name).is_relative_to(place) for place in allowed), name
        return [f"{output}/{WHOLE[command]}"] if command in WHOLE else names

    return names_of


@pytest.mark.parametrize("command", COMMANDS)
def test_what_stands_at_a_name_that_is_written_is_refused_and_stays(
    checkout, names_written, tmp_path, monkeypatch, command
):
    names = names_written(command)
    victim = tmp_path / "elsewhere" / "victim"
    victim.parent.mkdir()
    victim.write_text("mine")
    kinds = [kind for kind in KINDS if kind != "device" or os.geteuid() == 0]
    # Each kind at some name, each name with some kinds: all with all of them takes
    # minutes.
    for number, name in enumerate(names):
        for kind in kinds[number % 3 :: 3]:
            top = shutil.copytree(
                checkout, tmp_path / f"{number} {kind}", symlinks=True
            )
            monkeypatch.chdir(top)
            plant(top / name, kind, victim)
            before = listed(top)
            stopped = run(*COMMANDS[command][0])
            assert isinstance(stopped, InputError | str), (name, kind, stopped)
            message = str(stopped)
            assert len(message.splitlines()) == 1 and Path(name).name in message, (
                name,
                kind,
                message,
            )
            assert listed(top) == before, (name, kind)
            assert (
                os.listdir(victim.parent) == ["victim"] and victim.read_text() == "mine"
            ), (name, kind)
            monkeypatch.chdir(checkout)
            shutil.rmtree(top)


@pytest.mark.parametrize("command", ["plan", "export", "certificate"])
def test_a_command_that_is_killed_leaves_the_old_files_or_none(
    checkout, names_written, tmp_path, monkeypatch, command
):
    """Killed while it draws or writes: what it wrote has no final name; the next run
    replaces all of the old ones."""
    top = shutil.copytree(checkout, tmp_path / "top", symlinks=True)
    monkeypatch.chdir(top)
    arguments = COMMANDS[command][0]
    if command == "export":
        # The old files are not its own.
        arguments = (*arguments, "--force")
    names = [] if command in WHOLE else names_written(command)
    for name in names:
        (top / name).write_text("old")
    child = os.fork()
    if not child:
        monkeypatch.setattr(style, "save", lambda *_: os._exit(9))
        monkeypatch.setattr(typesetting, "compile_document", lambda *_: os._exit(9))
        monkeypatch.setattr(json_files, "write_json", lambda *_: os._exit(9))
        for module in (atomic_writes, exported):
            monkeypatch.setattr(
                module,
                "write_text",
                lambda path, text: (path.write_text(text), os._exit(9)),
            )
        run(*arguments)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    assert all((top / name).read_text() == "old" for name in names)
    assert not (top / "out/cell").exists()
    assert run(*arguments) is None
    assert all((top / name).read_bytes() != b"old" for name in names)


def test_a_folder_of_reports_that_is_a_link_is_refused(checkout, tmp_path, monkeypatch):
    top = shutil.copytree(checkout, tmp_path / "top", symlinks=True)
    monkeypatch.chdir(top)
    (top / "reports/loop/made").rename(tmp_path / "elsewhere")
    (top / "reports/loop/made").symlink_to(tmp_path / "elsewhere")
    before = listed(tmp_path / "elsewhere")
    stopped = run(*CERTIFICATE)
    assert isinstance(
        stopped, InputError
    ) and "reports/loop/made: found a link; allowed: a folder" in str(stopped)
    assert listed(tmp_path / "elsewhere") == before
