# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

import raysplats


@pytest.fixture(scope="session")
def context():
    return raysplats.Context()


def random_arrays(count=7, seed=3, sh_degree=2):
    """Arrays of Gaussians around the origin, as float64."""
    rng = np.random.default_rng(seed)
    return {
        "means": rng.uniform(-0.5, 0.5, (count, 3)),
        "quaternions": rng.normal(size=(count, 4)),
        "log_scales": np.log(rng.uniform(0.15, 0.4, (count, 3))),
        "opacities": rng.uniform(-1.5, 1.5, count),
        "sh": rng.normal(scale=0.3, size=(count, (sh_degree + 1) ** 2, 3)),
    }


def as_gaussians(arrays):
    return raysplats.Gaussians(**{k: v.astype(np.float32) for k, v in arrays.items()})


@pytest.fixture
def arrays():
    return random_arrays()
