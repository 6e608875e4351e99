"""An effect that a scene does not list adds no form, no unknown, no matrix entry and no term to the energy."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from dolfinx import fem

import fenicsmech as fm

from ..simulation.refined import arch

SPACES = ("plane-stress", "3d-symmetric")


@dataclass(frozen=True)
class Counts:
    """The parts of a simulation of two frames."""

    forms: int
    terms: int
    coefficients: int
    unknowns: int
    entries: int
    body_potentials: int


def counts(monkeypatch, space: str, effects=()) -> Counts:
    compiled = []
    plain = fem.form
    monkeypatch.setattr(fem, "form", lambda form, **options: compiled.append(form) or plain(form, **options))
    scene, push, load = arch(expansion=4e-5)
    scene = fm.Scene(scene.mechanism, effects=[effect(scene.mechanism) for effect in effects])
    simulation = fm.Simulation(scene, space=space, order=1, size=4.0)
    simulation.load_displacement(push, forces=[0.0, 0.1 * load])
    energy, model = simulation.model.elastic.energy_ufl, simulation.model
    matrix = simulation.solver(push).system.kkt.matrix()
    monkeypatch.undo()
    return Counts(
        len(compiled),
        len(energy.integrals()),
        len(energy.coefficients()),
        model.rigid_dofs + model.flexible_dofs + model.pressure_dofs,
        int(matrix.getInfo()["nz_used"]),
        len(model.potentials),
    )


def link(mechanism):
    return mechanism.flexible_links[0]


@pytest.mark.parametrize("space", SPACES)
def test_a_bare_scene_has_three_forms_and_one_term(space, monkeypatch):
    bare = counts(monkeypatch, space)
    assert bare.forms == 3  # energy, residual, stiffness
    assert bare.terms == 1
    assert bare.body_potentials == 0


@pytest.mark.thorough
@pytest.mark.parametrize("space", SPACES)
def test_each_effect_adds_only_its_own(space, monkeypatch):
    bare = counts(monkeypatch, space)
    weight = counts(monkeypatch, space, [lambda m: fm.Gravity((0, -9810))])
    # its term, its density, and the form of the residual's derivative by the load factor
    assert (weight.terms, weight.forms, weight.body_potentials) == (bare.terms + 1, bare.forms + 2, 0)
    assert (weight.unknowns, weight.entries) == (bare.unknowns, bare.entries)
    spring = counts(monkeypatch, space, [lambda m: fm.JointSpring(m.joints[0], 5.0)])
    assert (spring.forms, spring.terms, spring.coefficients) == (bare.forms, bare.terms, bare.coefficients)
    # its stiffness, and its preload, which designs may change
    assert (spring.unknowns, spring.body_potentials) == (bare.unknowns, 2)
    soft = counts(monkeypatch, space, [lambda m: fm.JointCompliance(m.joints[0], 1e-3)])
    assert soft == bare
    warm = counts(monkeypatch, space, [lambda m: fm.Temperature(5.0)])
    # its excess length in the strain energy, the form of the residual's derivative by the load factor, and two of the
    # stress that Newton's method predicts in steps as long as its first one
    assert (warm.terms, warm.forms, warm.coefficients) == (bare.terms, bare.forms + 3, bare.coefficients + 1)
    assert (warm.unknowns, warm.entries, warm.body_potentials) == (bare.unknowns, bare.entries, 0)
    assert counts(monkeypatch, space) == bare
