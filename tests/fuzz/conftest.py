"""How many inputs are tried: the suite's are always the same, `make fuzz` draws
others."""

import os

import hypothesis

hypothesis.settings.register_profile(
    "long",
    deadline=None,
    max_examples=int(os.environ.get("FUZZ_EXAMPLES", "3500")),
    derandomize=False,
    suppress_health_check=list(hypothesis.HealthCheck),
)
