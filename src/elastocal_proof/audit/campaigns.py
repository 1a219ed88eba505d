"""Audit of campaigns: simulated ones drawn again, the split of the poses, and seals of
the blind benchmark."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
import pinocchio as pin
import yaml

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.finished_run import (
    POSITION,
    WRENCH,
    Finding,
    FinishedRun,
    compare,
    open_philox_stream,
    require,
)

# Columns that are numbered anew when a campaign is read.
_RENUMBERED = ("session", "pose", "load", "repeat", "target", "row")
# Relative tolerance: positions are some metres and rotations some radians, and near
# half a turn rotation vectors lose digits.
_TOLERANCE = 1e-10


def check_simulated_campaign(
    run: FinishedRun, file: str, campaign: str
) -> Iterator[Finding]:
    """Every angle, load and noise of a simulated campaign from its stream, every pose
    of the elastic arm by pinocchio."""
    plan = _read_configuration(run, f"campaigns/{campaign}.yaml")
    if plan.get("source") != "simulated":
        return
    arm = Arm(_read_configuration(run, f"robots/{plan['robot']}.yaml"))
    stream = open_philox_stream(run.seed, campaign, "campaign")
    visits, angles, wrenches = _draw_visits(arm, plan, stream)
    deflected = [
        arm.deflect(arm.springs, q, wrench, 1)[0]
        for q, wrench in zip(angles, wrenches, strict=True)
    ]
    for point in plan["points"]:
        shifts = plan["noise_m"] * stream.standard_normal((len(visits), 3))
        turns = plan["noise_rad"] * stream.standard_normal((len(visits), 3))
        measured = [
            _disturb(arm.pose(coordinates, point), shift, turn)
            for coordinates, shift, turn in zip(deflected, shifts, turns, strict=True)
        ]
        rows = run.table(file).query("target == @point")
        for name, columns, expected in (
            ("visits", ["pose", "load", "repeat"], visits),
            ("wrenches", WRENCH, wrenches),
            ("joint angles", [f"q{j}" for j in range(1, arm.joints + 1)], angles),
            ("measured poses", [*POSITION, "rx", "ry", "rz"], measured),
        ):
            yield compare(
                f"{name} of {point}",
                "pinocchio, numpy's Philox stream",
                rows[[*columns]],
                expected,
                _TOLERANCE,
            )


def _read_configuration(run: FinishedRun, file: str) -> dict[str, Any]:
    """Document of the configuration's folder, empty where there is none."""
    path = run.folder / "config" / file
    return yaml.safe_load(path.read_text("utf-8")) if path.is_file() else {}


def _disturb(
    pose: tuple[np.ndarray, np.ndarray], shift: np.ndarray, turn: np.ndarray
) -> list[float]:
    """Position, m, and rotation vector, rad, of a pose with measuring noise."""
    position, rotation = pose
    return [*(position + shift), *pin.log3(pin.exp3(turn) @ rotation)]


def _draw_visits(
    arm: Arm, plan: Mapping[str, Any], stream: np.random.Generator
) -> tuple[list[tuple[int, int, int]], np.ndarray, np.ndarray]:
    """Draw the visits of a campaign in the order of its file.

    Returns
    -------
    visits : N times pose, load and repeat
    angles : (N, n) array, rad
    wrenches : (N, 6) array
    """
    poses = plan["poses"]
    low, high = np.deg2rad(arm.document["joint_limits_deg"]).T
    angles = low + (high - low) * stream.random((poses, arm.joints))
    normal = stream.standard_normal((poses, 3))
    forces = plan["force_N"] * normal / np.linalg.norm(normal, axis=1)[:, None]
    visits = []
    for pose in range(poses):
        for load in range(len(plan["ladder"])):
            # The first poses are approached several times without and with full load.
            is_repeated = pose < plan["repeated_poses"] and load < 2
            repeats = range(plan["repeats"] if is_repeated else 1)
            visits += [(pose, load, repeat) for repeat in repeats]
    pose_index, load_index, _ = np.transpose(visits)
    force = np.array(plan["ladder"])[load_index, None] * forces[pose_index]
    wrench = np.concatenate([force, np.cross(plan["offset_m"], force)], axis=1)
    return visits, angles[pose_index], wrench


def check_split(run: FinishedRun, file: str, campaign: str) -> Iterator[Finding]:
    """Fitted and held-out measurements are those of the campaign's file, each once, and
    share no pose."""
    source = f"data/campaigns/{campaign}/measurements.parquet"
    facts = run.document(f"results/loop/{campaign}/campaign.json")
    # A separate held-out campaign numbers its poses independently.
    if facts.get("held_out") is not None or not run.has(source):
        return
    fitted = run.table(file)
    held_out = run.table(file.replace("training", "held_out"))
    fitted_poses, held_out_poses = (
        set(zip(frame["session"], frame["pose"], strict=True))
        for frame in (fitted, held_out)
    )
    shared = fitted_poses & held_out_poses
    yield require(
        "no pose is fitted and held out",
        "counting",
        not shared,
        f"{sorted(shared)[:3]}",
        len(fitted),
    )
    original = run.table(source)
    rows = pd.concat([fitted, held_out]).sort_values("row")
    yield compare(
        "every row of the campaign once",
        "counting",
        rows["row"],
        np.arange(1, len(original) + 1),
        0.0,
    )
    values = [
        name
        for name in original.select_dtypes("number").columns
        if name in rows and name not in _RENUMBERED
    ]
    yield compare(
        "angles, loads and positions as measured",
        "the campaign's file",
        rows[values],
        original[values],
        0.0,
    )


def check_seals(run: FinishedRun, file: str) -> Iterator[Finding]:
    """Every ground truth of the blind benchmark has its sealed digest, and no sealed one is
    missing."""
    digests = {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (run.folder / "data/sealed").glob("*/*.json")
    }
    seals = (run.folder / file).read_text("utf-8").splitlines()
    broken = []
    for seal in seals:
        digest, _, name = seal.partition("  ")
        if digests.get(name) != digest:
            broken.append(name)
    yield require(
        "ground truths as they were sealed",
        "the seal",
        not broken,
        ", ".join(broken[:3]),
        len(seals),
    )


def check_held_out(run: FinishedRun, file: str, campaign: str) -> Iterator[Finding]:
    """As the split of the fitted poses."""
    return check_split(run, file.replace("held_out", "training"), campaign)


CHECKS = {
    "data/campaigns/{campaign}/measurements.parquet": check_simulated_campaign,
    "results/loop/{campaign}/training.parquet": check_split,
    "results/loop/{campaign}/held_out.parquet": check_held_out,
    "reports/blind/manifest.sha256": check_seals,
}
