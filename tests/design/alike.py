"""Equilibria found on different ways are the same."""

from __future__ import annotations

import numpy as np
import pytest

from fenicsmech.design import DesignEquilibria


def displacements(known: DesignEquilibria) -> np.ndarray:
    return np.concatenate(known.raw)


def assert_alike(followed: DesignEquilibria, traced: DesignEquilibria, *, digits: float = 1e-8) -> None:
    """The same states and displacements."""
    assert displacements(followed) == pytest.approx(displacements(traced), rel=digits)
    for sample, a in followed.samples.items():
        b = traced.samples[sample]
        assert a.unloaded.poses == pytest.approx(b.unloaded.poses, abs=digits * np.abs(b.state.poses).max())
        one, other = a.state, b.state
        assert one.u == pytest.approx(other.u, abs=digits * np.abs(other.u).max())
        assert one.poses == pytest.approx(other.poses, abs=digits * np.abs(other.poses).max())
        assert one.force == pytest.approx(other.force, rel=digits)
