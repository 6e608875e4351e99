"""An effect from outside the package, one class with one hook: an elastic foundation under a flexible link."""

from dataclasses import dataclass

import pytest
import ufl
from dolfinx import fem

import fenicsmech as fm


@dataclass(frozen=True)
class Foundation(fm.Effect):
    """V = ½ k ∫ |u|² dV on a link."""

    link: object
    stiffness: float

    def explain(self):
        return f"an elastic foundation under {self.link.name}"

    def link_energy(self, fields):
        stiffness = fields.number("stiffness", self.stiffness, [self.link])
        return fields.integral(0.5 * stiffness * ufl.dot(fields.u, fields.u), degree=2 * fields.order)


def simulation(stiffness: float | None, foundation: type[Foundation] = Foundation) -> tuple[fm.Simulation, object]:
    """A nearly rigid block on rails along x, the link between them, pushed along x."""
    mechanism = fm.Mechanism("sled")
    base, front, back = mechanism.rigid("base", fixed=True), mechanism.rigid("front"), mechanism.rigid("back")
    block = mechanism.flexible(
        "block", fm.strip([(0, 0), (30, 0)], thickness=4, depth=2), fm.Material("steel", 1e9, 0.0)
    )
    clamp = fm.Rectangle(4.0, 6.0)
    mechanism.weld(front, block, at=(28, 0), region=clamp)
    mechanism.weld(back, block, at=(2, 0), region=clamp)
    rail = mechanism.prismatic(base, front, at=(28, 0), axis=(1, 0))
    effects = [fm.JointSpring(rail, 1.0)]
    if stiffness is not None:
        effects.append(foundation(block, stiffness))
    push = mechanism.force(on=front, at=(28, 0), direction=(1, 0))
    return fm.Simulation(fm.Scene(mechanism, effects), space="plane-stress", size=4.0), push


def test_a_foundation_adds_its_stiffness_times_volume():
    volume = 30.0 * 4.0 * 2.0  # interfaces rest on it as well
    for stiffness in (None, 0.05):
        sled, push = simulation(stiffness)
        travel = sled.load_displacement(push, forces=[0.5]).displacements[-1]
        assert travel == pytest.approx(0.5 / (1.0 + (stiffness or 0.0) * volume), rel=1e-6)


def test_a_foundation_changes_the_tangent_by_the_mass_matrix():
    (bare, _), (held, _) = simulation(None), simulation(0.05)
    tangents = []
    for sled in (bare, held):
        elastic = sled.model.elastic
        matrix = elastic.create_stiffness()
        elastic.add_stiffness(matrix)
        matrix.assemble()
        ones = fem.Function(elastic.u.function_space)
        ones.x.array[::2] = 1.0
        # rigid motion along x: no elastic energy, all of the foundation's
        motion, result = matrix.createVecs()
        motion.array[:] = ones.x.array[: motion.getLocalSize()]
        matrix.mult(motion, result)
        tangents.append(motion.dot(result))
        motion.destroy(), result.destroy(), matrix.destroy()
    assert tangents[0] == pytest.approx(0.0, abs=1e-2)
    assert tangents[1] - tangents[0] == pytest.approx(0.05 * 240.0, rel=1e-2)
