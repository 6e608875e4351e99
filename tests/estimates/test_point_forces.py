"""Displacements under forces at points of flexible links grow without limit, as predicted; on regions they converge."""

from __future__ import annotations

import numpy as np
import pytest

import fenicsmech as fm


class Block:
    """A short, wide strip held at its left end, pressed from above or pulled at its right end."""

    def __init__(self, *, at=(30.0, 10.0), along=(0.0, -1.0), region=None, rigid=False) -> None:
        self.mechanism = fm.Mechanism("block")
        ground = self.mechanism.rigid("ground", fixed=True)
        shape = fm.strip([(0, 0), (40, 0)], thickness=20.0, depth=10.0)
        block = self.mechanism.flexible("block", shape, fm.Material("plastic", 1000.0, 0.3))
        self.mechanism.clamp(ground, block, end="start", length=5.0)
        link = block
        if rigid:
            link = self.mechanism.rigid("plate")
            self.mechanism.clamp(link, block, end="end", length=5.0)
        self.push = self.mechanism.force(on=link, at=at, direction=along, region=region, name="push")

    def curve(self, *, forces=(1.0,), **fidelity) -> fm.Curve:
        return fm.Simulation(fm.Scene(self.mechanism), **fidelity).load_displacement(self.push, forces=forces)

    def displacements(self, sizes, **fidelity) -> np.ndarray:
        return np.array([self.curve(size=size, **fidelity).displacements[0] for size in sizes])


@pytest.mark.parametrize(
    ("space", "at", "along"),
    [
        ("plane-stress", (30.0, 10.0), (0.0, -1.0)),
        pytest.param("plane-strain", (40.0, 0.0), (1.0, 0.0), marks=pytest.mark.thorough),
    ],
)
def test_each_halving_adds_as_much_as_flamant_says(space, at, along):
    block = Block(at=at, along=along)
    added = np.diff(block.displacements([2.5, 1.25, 0.625], space=space))
    predicted = block.curve(size=2.5, space=space).growth_by_halving[0]
    assert predicted > 4e-5
    assert added == pytest.approx([predicted, predicted], rel=0.05)


def test_designed_depths_and_moduli_count():
    block = Block()
    (link,) = block.mechanism.flexible_links
    simulation = fm.Simulation(fm.Scene(block.mechanism), space="plane-stress", size=5.0)
    numbers = {fm.Depth(link): 30.0, fm.LawParameter("E", link): 500.0}
    designed = simulation.with_design(fm.Design(np.zeros_like(simulation.model.elastic.shape.x.array), numbers))
    drawn, found = (own.load_displacement(block.push, forces=[1.0]) for own in (simulation, designed))
    assert found.growth_by_halving[0] == pytest.approx(drawn.growth_by_halving[0] * 10.0 / 30.0 * 1000.0 / 500.0)


@pytest.mark.thorough
def test_less_is_added_inside_a_link():
    block = Block(at=(30.0, 0.0))
    added = np.diff(block.displacements([2.5, 1.25], space="plane-stress"))[0]
    # Kelvin's problem: (3 − ν) (1 + ν) / 8 of it
    predicted = block.curve(size=2.5, space="plane-stress").growth_by_halving[0]
    assert added == pytest.approx(predicted * 2.7 * 1.3 / 8, rel=0.15)


def test_forces_at_given_displacements_shrink_as_much():
    block, found = Block(), []
    for size in (2.5, 1.25):
        simulation = fm.Simulation(fm.Scene(block.mechanism), space="plane-stress", size=size)
        found.append(simulation.load_displacement(block.push, displacements=[1e-3]))
    change = found[1].forces[0] - found[0].forces[0]
    assert change < 0.0
    assert found[0].growth_by_halving[0] == pytest.approx(change, rel=0.1)


@pytest.mark.thorough
def test_displacements_in_space_grow_with_one_over_the_size():
    block = Block(at=(40.0, 0.0), along=(1.0, 0.0))
    layers = {5.0: 1, 2.5: 2, 1.25: 4}
    curves = [block.curve(size=size, order=1, layers=n, space="3d-symmetric") for size, n in layers.items()]
    added = np.diff([curve.displacements[0] for curve in curves])
    predicted = [curve.growth_by_halving[0] for curve in curves[:2]]
    assert added[1] == pytest.approx(2.0 * added[0], rel=0.1)
    assert np.all((0.3 * added < predicted) & (predicted < 3.0 * added))


@pytest.mark.parametrize(
    ("region", "at", "along"),
    [
        pytest.param(fm.Disc(2.0), (30.0, 0.0), (0.0, -1.0), marks=pytest.mark.thorough),
        (fm.Face(within=fm.Rectangle(6.0, 1.0)), (30.0, 10.0), (0.0, -1.0)),
        pytest.param(fm.Face(), (40.0, 0.0), (1.0, 0.0), marks=pytest.mark.thorough),
    ],
)
def test_displacements_of_regions_converge(region, at, along):
    block = Block(region=region, at=at, along=along)
    added = np.abs(np.diff(block.displacements([5.0, 2.5, 1.25], space="plane-stress")))
    assert block.curve(size=5.0, space="plane-stress").growth_by_halving[0] == 0.0
    assert np.log2(added[0] / added[1]) >= 1.0


def test_explanations_and_estimates_name_the_cause(caplog):
    curve = Block().curve(size=2.5, space="plane-stress")
    (hint,) = (hint for hint in curve.explain().left_out if hint.what == "extent of the force")
    assert hint.matters
    assert "'push' acts at a point of flexible link 'block'" in hint.text
    assert "region=" in hint.text
    curve.error_estimates()
    assert "'push' acts at a point of flexible link 'block'" in caplog.text


@pytest.mark.parametrize("block", [Block(region=fm.Disc(2.0)), Block(rigid=True)], ids=["region", "rigid link"])
def test_there_is_no_cause_with_a_region_or_on_a_rigid_link(block, caplog):
    curve = block.curve(size=5.0, space="plane-stress")
    assert all(hint.what != "extent of the force" for hint in curve.explain().left_out)
    curve.error_estimates()
    assert "acts at a point" not in caplog.text


def test_accuracy_control_names_the_cause_instead_of_trying_finer_levels(caplog):
    block = Block()
    simulation = fm.Simulation(fm.Scene(block.mechanism), accuracy=0.02)
    simulation.load_displacement(block.push, forces=[1.0])
    choice = simulation.choice
    assert choice is not None
    assert not choice.reached
    assert len(choice.trials) == 1
    for text in (str(choice), caplog.text):
        assert "'push' acts at a point of flexible link 'block'" in text
        assert "region=" in text


def test_accuracy_control_reaches_the_accuracy_with_a_region():
    block = Block(region=fm.Face(), at=(40.0, 0.0), along=(1.0, 0.0))
    simulation = fm.Simulation(fm.Scene(block.mechanism), accuracy=0.1)
    simulation.load_displacement(block.push, forces=[1.0])
    assert simulation.choice is not None
    assert simulation.choice.reached
    assert "acts at a point" not in str(simulation.choice)
