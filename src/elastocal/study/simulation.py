"""Data sets as the paper makes them: random configurations and forces, exact
deflections, noise; and their tables on disk.

Arrays have the axes (data set, configuration, ...), and those from tables lie component
first in memory.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.origin import describe_provenance
from elastocal.io.storage import TableSchema, read_blocks, write_table
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.components import (
    COMPONENT_NAMES,
    COMPONENTS,
    WRENCH,
    WRENCH_NAMES,
)
from elastocal.mechanics.elastostatics import (
    exact_deflections,
    extended_chain,
    generalized_forces,
    loaded_point,
    spring_compliance,
    wrench_of_offset_force,
)
from elastocal.mechanics.kinematics import jacobians, poses
from elastocal.mechanics.robot_file import joint_limits
from elastocal.random_streams import draw_data_sets
from elastocal.study.jobs import (
    CONFIGURATION,
    DATA_SET,
    Job,
    collect_provenance,
    load_robot,
    make_group_column,
    make_integer_column,
    make_real_column,
    make_schema,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.mechanics.chain import Chain, MeasuringPoint
    from elastocal.mechanics.robot import Robot

# What a step holds in memory at a time.
SETS_PER_BLOCK = 500

DEFLECTIONS = make_schema(
    "deflections",
    make_group_column("point", "measuring point; a row group holds one"),
    DATA_SET,
    CONFIGURATION,
    *(
        make_real_column(name, unit, f"{meaning}, loaded against unloaded")
        for name, unit, meaning in COMPONENTS
    ),
)
# All that `to_deflections` looks at.
DEFLECTION_COLUMNS = ("configuration", *COMPONENT_NAMES)

INITIAL = make_schema(
    "initial",
    DATA_SET,
    make_integer_column("configurations", "configurations in the data set", 1),
    make_real_column(
        "mean",
        "m",
        "mean over the data set of the end-effector's displacement under load",
        minimum=0,
    ),
    make_real_column("mean_square", "m^2", "mean square of the same", minimum=0),
    make_real_column("maximum", "m", "largest of the same", minimum=0),
)


DATA_SETS = "data sets"
TESTS = "test configurations"
REPLICATE = make_integer_column(
    "replicate", "number of the bootstrap replicate, from 1", 1
)
WEIGHTS = make_schema(
    "weights",
    make_group_column(
        "members",
        "what counts: data sets or test configurations; a row group holds one",
    ),
    make_integer_column(
        "number", "number of the data set or test configuration, from 0", 0
    ),
    REPLICATE,
    make_integer_column("count", "how often it counts in the replicate", 0),
)


def make_experiments_schema(joints: int) -> TableSchema:
    """Configurations and wrenches; one row for each loaded configuration."""
    angles = [
        make_real_column(f"q{j}", "rad", f"angle of joint {j}")
        for j in range(1, joints + 1)
    ]
    wrench = [
        make_real_column(name, unit, f"{meaning}, at the end-effector")
        for name, unit, meaning in WRENCH
    ]
    return make_schema("experiments", DATA_SET, CONFIGURATION, *angles, *wrench)


@dataclass(frozen=True)
class Experiments:
    """Loaded configurations of a robot.

    `joint_angles` (sets, configurations, n): rad. `wrench` (sets, configurations, 6):
    N, N m at the end-effector, base axes.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray


@dataclass(frozen=True)
class Loading:
    """How the robot is moved and loaded.

    `force_N`: magnitude. `direction`: of the force, base axes; without one it is
    uniform on the sphere. `offset_m`: from the end-effector to where the force acts.
    `offset_frame`: axes of the offset (interpretation R4). `joint_range`: joint angles
    uniform in +-pi or within the robot's limits (interpretation R3).
    """

    force_N: float
    offset_m: tuple[float, ...]
    offset_frame: str
    joint_range: str
    direction: tuple[float, ...] | None = None


def draw_random_experiments(
    chain: Chain,
    limits: np.ndarray,
    seed: int,
    key: str,
    loading: Loading,
    purpose: str,
    data_sets: Sequence[int] | np.ndarray,
    configurations: int,
) -> Experiments:
    """Random configurations and wrenches.

    Forces have the directions of normal vectors, which are uniform on the sphere [1].

    `limits` (n, 2): joint limits in rad. `key`: name of the robot's file; part of the
    name of the random streams. `purpose`: part of the name of the random streams: data
    that identify and data that judge never share one. `configurations`: in each data
    set; the first k of them do not depend on how many there are.

    [1] Muller, M. E., A note on a method for generating points uniformly on n-dimensional spheres, Communications of the ACM 2,
        1959.
    """
    n = chain.coordinates
    turns = draw_data_sets(
        seed,
        key,
        f"{purpose}/joint angles",
        data_sets,
        lambda stream: stream.random((configurations, n)),
    )
    low, high = (
        limits.T
        if loading.joint_range == "limits"
        else (np.full(n, -np.pi), np.full(n, np.pi))
    )
    joint_angles = low + (high - low) * turns
    if loading.direction is None:
        normal = draw_data_sets(
            seed,
            key,
            f"{purpose}/force",
            data_sets,
            lambda stream: stream.standard_normal((configurations, 3)),
        )
    else:
        normal = np.broadcast_to(
            np.array(loading.direction, float), (*joint_angles.shape[:-1], 3)
        )
    force = loading.force_N * normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    rotation = (
        poses(chain, joint_angles, chain.end_effector)[1]
        if loading.offset_frame == "tool"
        else None
    )
    return Experiments(
        joint_angles, wrench_of_offset_force(force, loading.offset_m, rotation)
    )


def compute_true_deflections(
    robot: Robot, experiments: Experiments, point: MeasuringPoint, wrench_at: str
) -> np.ndarray:
    """Deflection of a measuring point: theta from equation 7, then the exact kinematics
    of all springs.

    The virtual joint method, see `mechanics.elastostatics`. `robot`: reduced or, where
    it has links, extended. `point`: of the robot's chain. `wrench_at`: where the wrench
    that deflects a partial point is taken to act (interpretation R6). Returns (sets,
    configurations, 6): m, rad.
    """
    chain = extended_chain(robot)
    unloaded = chain.at(experiments.joint_angles)
    measured = replace(chain.point(point.name), offset_m=point.offset_m)
    jacobian = jacobians(chain, unloaded, loaded_point(chain, measured, wrench_at))
    springs = generalized_forces(jacobian, experiments.wrench) @ spring_compliance(
        robot
    )
    return exact_deflections(chain, unloaded, springs, measured)


def draw_measurement_noise(
    seed: int,
    key: str,
    point_name: str,
    data_sets: Sequence[int] | np.ndarray,
    configurations: int,
) -> np.ndarray:
    """Standard normal noise (sets, configurations, 6) at one measuring point; times the
    noise level it is the error.

    The same numbers serve every noise level, so that levels differ by scale alone:
    common random numbers [1].

    [1] Glasserman, P. and Yao, D. D., Some guidelines and guarantees for common random
    numbers, Management Science 38, 1992.
    """
    return draw_data_sets(
        seed,
        key,
        f"noise/{point_name}",
        data_sets,
        lambda stream: stream.standard_normal((configurations, 6)),
    )


def split_data_sets(data_sets: int) -> Iterator[range]:
    """Numbers of so many data sets, block by block."""
    for first in range(0, data_sets, SETS_PER_BLOCK):
        yield range(first, min(first + SETS_PER_BLOCK, data_sets))


def make_prefix_index(
    sets: Sequence[int] | np.ndarray, lengths: int
) -> dict[str, np.ndarray]:
    """Columns that number the rows of a block with one row for each data set and prefix
    length."""
    return {
        "data_set": np.repeat(np.asarray(sets), lengths),
        "length": np.tile(np.arange(1, lengths + 1), len(sets)),
    }


def list_data_sets(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Numbers of the data sets of a block, (sets,), whose rows stand together."""
    numbers = columns["data_set"]
    return numbers[np.flatnonzero(np.diff(numbers, prepend=-1))]


def pack_experiments(
    sets: Sequence[int] | np.ndarray, experiments: Experiments
) -> dict[str, np.ndarray]:
    """Block of the experiments table."""
    columns = _index_columns(sets, experiments.joint_angles.shape[1])
    columns |= {
        f"q{j + 1}": angle.ravel()
        for j, angle in enumerate(np.moveaxis(experiments.joint_angles, -1, 0))
    }
    return columns | _component_columns(WRENCH_NAMES, experiments.wrench)


def unpack_experiments(columns: Mapping[str, np.ndarray]) -> Experiments:
    """Experiments of a block."""
    angles = [f"q{j + 1}" for j in range(sum(name[0] == "q" for name in columns))]
    return Experiments(_stacked(columns, angles), _stacked(columns, WRENCH_NAMES))


def unpack_deflections(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Deflections (sets, configurations, 6) of a block."""
    return _stacked(columns, COMPONENT_NAMES)


def _index_columns(
    sets: Sequence[int] | np.ndarray, configurations: int
) -> dict[str, np.ndarray]:
    return {
        "data_set": np.repeat(np.asarray(sets), configurations),
        "configuration": np.tile(np.arange(configurations), len(sets)),
    }


def _component_columns(
    names: Sequence[str], values: np.ndarray
) -> dict[str, np.ndarray]:
    return {name: values[..., k].ravel() for k, name in enumerate(names)}


def _stacked(columns: Mapping[str, np.ndarray], names: Sequence[str]) -> np.ndarray:
    configurations = int(columns["configuration"].max()) + 1
    return np.moveaxis(
        np.stack([columns[name].reshape(-1, configurations) for name in names]), 0, -1
    )


def simulate_blocks(
    experiments: Iterable[Mapping[str, np.ndarray]], robot: Robot, wrench_at: str
) -> Iterator[dict[str, np.ndarray | str]]:
    """Deflections without noise: of each block of experiments one block for each
    measuring point."""
    for block in experiments:
        loaded = unpack_experiments(block)
        sets = list_data_sets(block)
        for point in robot.chain.points:
            deflections = compute_true_deflections(robot, loaded, point, wrench_at)
            numbers = _index_columns(sets, deflections.shape[1])
            yield {
                "point": point.name,
                **numbers,
                **_component_columns(COMPONENT_NAMES, deflections),
            }


def add_noise_to_blocks(
    ideal_blocks: Iterable[dict[str, np.ndarray]], key: str, seed: int, noise: float
) -> Iterator[dict[str, np.ndarray | str]]:
    """Deflections as measured: ideal plus independent normal noise on every component.

    `key`: name of the robot's file. `noise`: standard deviation, the same number in m
    and rad.
    """
    for block in ideal_blocks:
        point = block["point"][0]
        normal = draw_measurement_noise(
            seed,
            key,
            point,
            list_data_sets(block),
            int(block["configuration"].max()) + 1,
        )
        measured = {
            name: block[name] + noise * normal[..., k].ravel()
            for k, name in enumerate(COMPONENT_NAMES)
        }
        yield block | measured | {"point": point}


def summarize_displacements(displacement: np.ndarray) -> dict[str, np.ndarray]:
    """How far each data set of displacements (sets, configurations, 3 or more) bends:
    columns of sizes."""
    size = np.linalg.norm(displacement[..., :3], axis=-1)
    return {
        "mean": size.mean(axis=1),
        "mean_square": (size**2).mean(axis=1),
        "maximum": size.max(axis=1),
    }


def compute_statistics(frame: pd.DataFrame) -> dict[str, pd.Series]:
    """Mean, standard deviation and largest of the deflections of each data set, m, of
    the initial table or that of tubes."""
    return {
        "mean": frame["mean"],
        "std": (frame.mean_square - frame["mean"] ** 2) ** 0.5,
        "max": frame.maximum,
    }


def draw_bootstrap_weights(
    seed: int, key: str, data_sets: Sequence[int] | np.ndarray, replicates: int
) -> np.ndarray:
    """How often each data set counts in each replicate: once in replicate 0, Poisson(1)
    times in the others.

    The Poisson bootstrap [1], whose independent weights of mean one do not need to know
    how many data sets there are. They are the same for every noise level and strategy,
    so that replicates of two of them may be compared one by one.

    `seed`, `key`: as in `random_streams.open_stream`. Returns (1 + replicates, sets).

    [1] Hanley, J. A. and MacGibbon, B., Creating non-parametric bootstrap samples using Poisson frequencies, Computer Methods
        and Programs in Biomedicine 83, 2006.
    """
    counts = draw_data_sets(
        seed,
        key,
        "bootstrap",
        data_sets,
        lambda stream: stream.poisson(1.0, replicates),
    )
    return np.vstack([np.ones(len(counts)), counts.T])


def draw_weight_blocks(
    key: str, seed: int, data_sets: int, tests: int, replicates: int
) -> Iterator[dict[str, np.ndarray | str]]:
    """How often each data set and each test configuration counts in each bootstrap
    replicate.

    Yields columns of the weights table: data sets in the blocks of the experiments,
    then all test configurations.
    """
    for sets in split_data_sets(data_sets):
        yield _weight_columns(
            DATA_SETS, sets, draw_bootstrap_weights(seed, key, sets, replicates)[1:].T
        )
    of_tests = draw_data_sets(
        seed,
        key,
        "bootstrap of tests",
        [0],
        lambda stream: stream.poisson(1.0, (replicates, tests)),
    )[0]
    yield _weight_columns(TESTS, range(tests), of_tests.T)


def _weight_columns(
    members: str, numbers: Sequence[int], counts: np.ndarray
) -> dict[str, np.ndarray | str]:
    return {
        "members": members,
        "number": np.repeat(numbers, counts.shape[1]),
        "replicate": np.tile(np.arange(1, counts.shape[1] + 1), len(counts)),
        "count": counts.ravel(),
    }


def draw_experiments(job: Job) -> None:
    """Random configurations and loads of one robot."""
    asked = job.params
    robot = job.wildcards.robot
    chain = parse_chain(asked.chain, asked.lengths_m, robot)
    limits = joint_limits(asked.joint_limits_deg, chain, robot)
    loading = Loading(**asked.loading)
    blocks = (
        pack_experiments(
            sets,
            draw_random_experiments(
                chain,
                limits,
                asked.seed,
                robot,
                loading,
                asked.purpose,
                sets,
                asked.configurations,
            ),
        )
        for sets in split_data_sets(asked.data_sets)
    )
    write_table(
        job.output.experiments,
        make_experiments_schema(chain.coordinates),
        blocks,
        describe_provenance(asked),
    )


def draw_weights(job: Job) -> None:
    """Bootstrap weights of one robot, drawn once for all strategies and noise
    levels."""
    asked = job.params
    drawn = draw_weight_blocks(
        job.wildcards.robot, asked.seed, asked.data_sets, asked.tests, asked.replicates
    )
    write_table(job.output.weights, WEIGHTS, drawn, collect_provenance(job))


def simulate(job: Job) -> None:
    """Deflections of one robot without noise."""
    robot = load_robot(job)
    blocks = simulate_blocks(
        read_blocks(job.input.experiments, make_experiments_schema(robot.joints)),
        robot,
        job.params.wrench_at,
    )
    write_table(job.output.ideal, DEFLECTIONS, blocks, describe_provenance(job.params))


def measure(job: Job) -> None:
    """Deflections of one robot as measured at one noise level."""
    ideal = read_blocks(job.input.ideal, DEFLECTIONS)
    blocks = add_noise_to_blocks(
        ideal, job.wildcards.robot, job.params.seed, 1e-6 * float(job.wildcards.noise)
    )
    write_table(
        job.output.measured,
        DEFLECTIONS,
        blocks,
        describe_provenance(job.params, noise_um=job.wildcards.noise),
    )


def summarize_initial(job: Job) -> None:
    """How far a robot bends before any calibration (Table 2), data set by data set."""
    ideal = read_blocks(job.input.ideal, DEFLECTIONS, point=job.params.end_effector)
    blocks = (
        {
            "data_set": list_data_sets(block),
            "configurations": np.full(
                len(list_data_sets(block)), int(block["configuration"].max()) + 1
            ),
            **summarize_displacements(unpack_deflections(block)),
        }
        for block in ideal
    )
    write_table(job.output.initial, INITIAL, blocks, describe_provenance(job.params))
