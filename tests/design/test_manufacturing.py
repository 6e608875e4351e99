"""Limits of manufacture hold a design back, and its exported outline keeps them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.interpolate import BSpline

import fenicsmech as fm
from fenicsmech.meshing import link_outline

from .shapes import ARCH

EYE = 2.5
KEPT = 1e-3  # the last change of a correction, relative


class Arch:
    """An arch on two pins, whose shape may change."""

    def __init__(self) -> None:
        mechanism = fm.Mechanism("arch")
        ground = mechanism.rigid("ground", fixed=True)
        self.link = mechanism.flexible("arch", fm.strip(ARCH, thickness=3.0, depth=5.0), fm.ONYX)
        for at in (ARCH[0], ARCH[2]):
            mechanism.revolute(ground, self.link, at=at, interface_radius=EYE)
        self._scene = fm.Scene(mechanism)

    def designed(self, folder: Path, *targets: fm.Target) -> tuple[fm.DesignResult, list[np.ndarray]]:
        """The design, and points on both exported sides between the eyes with two derivatives each, (3, n, 2)."""
        sim = fm.Simulation(self._scene, space="plane-stress", size=2.0)
        problem = fm.DesignProblem(sim, [fm.SplineDesign(self.link, 2, thickness=(1.0, 6.0))], targets=targets)
        result = problem.optimise()
        problem.export(folder, result)
        sides = []
        for curve in link_outline("arch", fm.step_file(folder / "arch.step", depth=5.0), dim=2):
            if isinstance(curve, BSpline):
                t = np.linspace(curve.t[0], curve.t[-1], 1000)
                points = np.array([curve(t, order) for order in range(3)])
                off = np.min([np.linalg.norm(points[0] - pin, axis=1) for pin in (ARCH[0], ARCH[2])], axis=0)
                sides.append(points[:, off > 1.01 * EYE])
        return result, sides


def curvature(side: np.ndarray) -> np.ndarray:
    """|x′ × x″| / |x′|³ of points with two derivatives."""
    _, (x, y), (xx, yy) = np.moveaxis(side, 2, 1)
    return np.abs(x * yy - y * xx) / np.hypot(x, y) ** 3


def test_the_lightest_leg_keeps_off_an_obstacle_under_load():
    """Also in the exported part, remeshed with smaller elements."""
    mechanism = fm.Mechanism("leg")
    ground, tip = mechanism.rigid("ground", fixed=True), mechanism.rigid("tip")
    leg = mechanism.flexible("leg", fm.strip([(0, 0), (0, 40)], thickness=3.0, depth=5.0), fm.ONYX)
    mechanism.weld(ground, leg, at=(0, 0), interface_radius=2.0)
    mechanism.weld(leg, tip, at=(0, 40), interface_radius=2.0)
    push = mechanism.force(on=tip, at=(0, 40), direction=(1, 0))
    sim = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=3.0)
    gap, least = fm.LeastGap(leg, fm.Cylinder((7.0, 28.0), 3.0)), 0.5
    targets = [fm.Target(fm.LinkMass(leg), least=True), fm.Target(gap, fm.Sample({push: 2.0}), at_least=least)]
    problem = fm.DesignProblem(sim, [fm.SplineDesign(leg, 2, thickness=(1.5, 6.0))], targets=targets)
    result = problem.verify(problem.optimise())
    mass, limited = result.targets
    assert result.converged and mass.corrected < 0.8 * mass.started
    assert least * (1.0 - KEPT) <= limited.corrected <= 1.05 * least
    assert limited.part is not None
    assert limited.part.value + limited.part.finer_elements_add >= 0.98 * least


def test_the_lightest_arch_is_as_thin_as_can_be_made(tmp_path):
    own, least = Arch(), 2.2
    mass, thickness = fm.LinkMass(own.link), fm.LeastThickness(own.link)
    result, (one, other) = own.designed(tmp_path, fm.Target(mass, least=True), fm.Target(thickness, at_least=least))
    lightest, limited = result.targets
    assert result.converged and lightest.corrected < 0.85 * lightest.started
    assert least * (1.0 - KEPT) <= limited.corrected <= 1.01 * least
    exported = np.linalg.norm(one[0][:, None] - other[0], axis=2).min()
    assert abs(exported - limited.corrected) <= 2e-3 * least


def test_a_longer_arch_bends_no_more_than_can_be_made(tmp_path):
    own, most = Arch(), 1.0 / 12.0
    length, sharpest = fm.CentrelineLength(own.link), fm.LargestCurvature(own.link)
    targets = fm.Target(length, equals=52.0), fm.Target(sharpest, at_most=most)
    result, sides = own.designed(tmp_path, *targets)
    limited = result.targets[1]
    assert result.converged and result.targets[0].met
    assert 0.98 * most <= limited.corrected <= most * (1.0 + KEPT)
    exported = max(float(curvature(side).max()) for side in sides)
    assert exported <= 1.05 * most  # the file's spline swings about the circles through three of its points


def test_limits_alone_change_a_link_until_they_hold():
    """Nothing else is wanted; elements are as wide as the link, with one of its handles at the rim of a clamp."""
    mechanism = fm.Mechanism("beam")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    shape = fm.strip([(0, 0), (20, 0)], thickness=1.0, depth=1.0)
    beam = mechanism.flexible("beam", shape, fm.Material("plastic", 1e6, 0.3))
    mechanism.clamp(base, beam, end="start", length=1.0)
    mechanism.clamp(hand, beam, end="end", length=1.0)
    push = mechanism.force(on=hand, at=(20, 0), direction=(0, 1))
    simulation = fm.Simulation(fm.Scene(mechanism), space="plane-stress", size=1.0, comm=MPI.COMM_SELF)
    drawn = simulation.load_displacement(push, forces=[0.1]).frames[-1].peak.value
    limits = fm.limits(fm.LargestStress(), fm.Sample({push: 0.1}), at_most=0.75 * drawn)
    result = fm.DesignProblem(simulation, [fm.SplineDesign(beam, 2, thickness=(0.5, 3.0))], targets=limits).optimise()
    peak = simulation.with_design(result).load_displacement(push, forces=[0.1]).frames[-1].peak
    assert result.converged
    assert peak.value + peak.error < 0.75 * drawn * (1.0 + KEPT)
