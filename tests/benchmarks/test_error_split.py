from dataclasses import replace

import pytest

from benchmarks.work_precision import FidelityLevel, Limit, Measurement, split_error
from fenicsmech.elasticity import PLANE_STRESS

OWN, REFERENCE = Limit(11.0, 0.1, 2.0, 3), Limit(10.0, 0.1, 2.0, 3)


def measured():
    """The same level at three tolerances, and another one."""
    values = {1e-4: 10.7, 1e-6: 10.65, 1e-10: 10.6}
    base = FidelityLevel(PLANE_STRESS, 2)
    levels = [Measurement(replace(base, tolerance=tolerance), value) for tolerance, value in values.items()]
    return [*levels, Measurement(replace(base, order=1, tolerance=1e-12), 9.0), Measurement(base)]


def test_parts_add_up_to_the_error():
    measurements = measured()
    for measurement in measurements[:4]:
        split = split_error(measurement, measurements, own=OWN, reference=REFERENCE)
        assert split.total == pytest.approx(measurement.value - REFERENCE.value, rel=1e-12)
        assert split.magnitude >= abs(split.total)


def test_algebraic_error_is_against_the_tightest_tolerance_of_the_same_level():
    measurements = measured()
    loose, _, tight, other, _ = (
        split_error(m, measurements, own=OWN, reference=REFERENCE) if m.value else None for m in measurements
    )
    assert loose.algebraic == pytest.approx(0.1)
    assert tight.algebraic == other.algebraic == 0.0
    assert loose.discretisation == tight.discretisation == pytest.approx(-0.4)
    assert loose.modelling == pytest.approx(1.0)
    assert loose.magnitude == pytest.approx(1.5)
