"""Components of a displacement and of a wrench, and quantities of joints, by the names
that all tables and files use."""

COMPONENT_NAMES = ("dx", "dy", "dz", "rx", "ry", "rz")
WRENCH_NAMES = ("fx", "fy", "fz", "mx", "my", "mz")


def list_joint_columns(joints: int, prefix: str = "q") -> list[str]:
    """List the columns with a quantity of each joint: q1, q2 ... are joint angles."""
    return [f"{prefix}{joint}" for joint in range(1, joints + 1)]
