"""Motions that joints leave to links that bend no further carry every body of a link along, at any pose."""

import numpy as np
import pytest

import fenicsmech as fm
from fenicsmech.multibody import assemble, build_linkage, stiff_motions


def slider_crank() -> tuple[fm.Mechanism, object]:
    """A crank, a flexible rod, and a slider with its joint."""
    mechanism = fm.Mechanism("slider-crank")
    base, crank, slider = (mechanism.rigid(name, fixed=name == "base") for name in ("base", "crank", "slider"))
    rod = mechanism.flexible("rod", fm.strip([(10, 20), (60, 0)], thickness=2.0, depth=3.0), fm.ONYX)
    mechanism.revolute(base, crank, at=(0, 0))
    mechanism.revolute(crank, rod, at=(10, 20), interface_radius=1.0)
    mechanism.revolute(rod, slider, at=(60, 0), interface_radius=1.0)
    return mechanism, mechanism.prismatic(base, slider, at=(60, 0), axis=(1, 0))


@pytest.mark.parametrize("dim", [2, 3])
def test_the_motion_of_a_slider_crank_is_the_rate_of_its_assembly(dim):
    driven, joint = slider_crank()
    motor, scene = driven.motor(joint), fm.Scene(driven)
    linkage = build_linkage(driven, dim)

    def poses(travel: float) -> np.ndarray:
        return assemble(linkage, scene.configuration("there", {motor: travel})).poses

    # far from the drawn pose, where errors of second order show
    here, step = poses(-9.0), 1e-4
    rate = linkage.joints.unknowns(poses(-9.0 + step) - poses(-9.0 - step)) / (2.0 * step)
    free = build_linkage(slider_crank()[0], dim)
    (motion,) = stiff_motions(free, here, np.zeros(4), np.arange(free.joints.rows))
    amplitude = (motion.z @ rate) / (rate @ rate)
    assert motion.z == pytest.approx(amplitude * rate, abs=1e-7 * np.abs(motion.z).max())
    first, second = free.interfaces[driven.flexible_links[0]]
    apart = here[second, :dim] - here[first, :dim] + np.array([50.0, -20.0, 0.0])[:dim]
    assert motion.velocity[second] == pytest.approx(motion.at(first, apart[None])[0])
    held = linkage.joints.motor_values(lambda motor: -9.0)
    assert stiff_motions(linkage, here, held, np.arange(linkage.joints.rows)) == []
    # without its pin, the slider moves beside the crank and the rod
    pin = np.array([name.startswith(driven.joints[2].name) for name in free.joints.row_names])
    assert len(stiff_motions(free, here, np.zeros(4), np.flatnonzero(~pin))) == 3
