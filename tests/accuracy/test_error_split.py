import pytest

from fenicsmech.accuracy import Limit, Measurement, Rung, split_error
from fenicsmech.elasticity import PLANE_STRESS

OWN, REFERENCE = Limit(11.0, 0.1, 2.0, 3), Limit(10.0, 0.1, 2.0, 3)


def ladder():
    """The same rung at three tolerances, and another one."""
    values = {1e-4: 10.7, 1e-6: 10.65, 1e-10: 10.6}
    rungs = [Measurement(Rung(PLANE_STRESS, 2, tolerance=tolerance), value) for tolerance, value in values.items()]
    return [*rungs, Measurement(Rung(PLANE_STRESS, 1, tolerance=1e-12), 9.0), Measurement(Rung(PLANE_STRESS, 2))]


def test_parts_add_up_to_the_error():
    measurements = ladder()
    for measurement in measurements[:4]:
        split = split_error(measurement, measurements, own=OWN, reference=REFERENCE)
        assert split.total == pytest.approx(measurement.value - REFERENCE.value, rel=1e-12)
        assert split.magnitude >= abs(split.total)


def test_algebraic_error_is_against_the_tightest_tolerance_of_the_same_rung():
    measurements = ladder()
    loose, _, tight, other, _ = (
        split_error(m, measurements, own=OWN, reference=REFERENCE) if m.value else None for m in measurements
    )
    assert loose.algebraic == pytest.approx(0.1)
    assert tight.algebraic == other.algebraic == 0.0
    assert loose.discretisation == tight.discretisation == pytest.approx(-0.4)
    assert loose.modelling == pytest.approx(1.0)
    assert loose.magnitude == pytest.approx(1.5)
