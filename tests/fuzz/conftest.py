"""Number of inputs that are tried. The test suite always tries the same ones; `make
fuzz` draws new ones."""

import os

import hypothesis

hypothesis.settings.register_profile(
    "long",
    deadline=None,
    max_examples=int(os.environ.get("FUZZ_EXAMPLES", "3500")),
    derandomize=False,
    suppress_health_check=list(hypothesis.HealthCheck),
)
