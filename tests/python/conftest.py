# SPDX-License-Identifier: Apache-2.0
import concurrent.futures
import sys

import numpy as np
import pytest

import raysplats

# Of the confidence ellipsoids.
QUANTILE = 11.3449
# Of the largest number of a class of parameters.
TOLERANCE = 1e-4


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


@pytest.fixture
def hasty_threads():
    """The interpreter changes threads as often as it can."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual)


def assert_threads_find(calls, expected, rounds=25):
    """Functions of tensors that are called again and again, each in a thread of its own, find what they find alone."""

    def again(call):
        return [call() for _ in range(rounds)]

    with concurrent.futures.ThreadPoolExecutor(len(calls)) as threads:
        found = [each.result() for each in [threads.submit(again, call) for call in calls]]
    for several, one in zip(found, expected):
        for each in several:
            assert each.allclose(one, rtol=1e-4, atol=1e-4 * one.abs().max())
