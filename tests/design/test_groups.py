"""Groups of processes: how many, and that every target has exactly one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import pytest
from mpi4py import MPI

from fenicsmech.design import group_count, split


@dataclass(frozen=True)
class World:
    """One process of a communicator of ``size``; ``Split`` tells which of its parts this one is in."""

    rank: int
    size: int
    attributes: dict[int, object] = field(default_factory=dict)

    def Get_attr(self, key: int) -> object | None:
        return self.attributes.get(key)

    def Set_attr(self, key: int, value: object) -> None:
        self.attributes[key] = value

    def Split(self, *, color: int, key: int) -> Part:
        return Part(color, key)


@dataclass(frozen=True)
class Part:
    color: int
    key: int


def groups_of(processes: int, targets: int):
    return [split(World(rank, processes), range(targets)) for rank in range(processes)]


@pytest.mark.parametrize(
    ("processes", "targets", "groups"),
    [
        (1, 5, 1),  # alone
        (2, 1, 1),  # nothing to distribute
        (2, 2, 2),
        (2, 3, 2),  # two rounds of one beat three rounds at 1.4 times the speed
        (4, 2, 2),
        (4, 3, 3),  # one target each in one round; the fourth process helps one group
        (4, 4, 4),
        (3, 2, 2),
        (8, 3, 3),
        (8, 6, 6),
    ],
)
def test_number_of_groups(processes, targets, groups):
    assert group_count(processes, targets) == groups


@pytest.mark.parametrize("processes", range(1, 9))
@pytest.mark.parametrize("targets", range(1, 7))
def test_number_of_groups_has_the_shortest_expected_time(processes, targets):
    def seconds(groups: int) -> float:
        return math.ceil(targets / groups) / math.sqrt(processes // groups)

    best = min(seconds(groups) for groups in range(1, min(processes, targets) + 1))
    assert seconds(group_count(processes, targets)) == pytest.approx(best)


@pytest.mark.parametrize("processes", range(1, 9))
@pytest.mark.parametrize("targets", range(1, 7))
def test_every_target_is_in_exactly_one_group_and_every_group_has_targets_and_neighbouring_processes(
    processes, targets
):
    groups = groups_of(processes, targets)
    count = group_count(processes, targets)
    if count == 1:
        assert all(group.comm == group.everyone and group.mine == tuple(range(targets)) for group in groups)
        return
    colours = [group.comm.color for group in groups]
    assert colours == sorted(colours)
    assert set(colours) == set(range(count))
    assert [group.comm.key for group in groups] == list(range(processes))
    targets_of = {group.comm.color: group.mine for group in groups}
    assert all(targets_of[group.comm.color] == group.mine for group in groups)
    assert sorted(k for mine in targets_of.values() for k in mine) == list(range(targets))
    sizes = [len(mine) for mine in targets_of.values()]
    assert max(sizes) - min(sizes) <= 1
    shares = [colours.count(colour) for colour in set(colours)]
    assert max(shares) - min(shares) <= 1


@pytest.mark.parallel
@pytest.mark.parametrize("targets", range(1, 5))
def test_communicators_are_those_of_the_groups(targets):
    world = MPI.COMM_WORLD
    group = split(world, range(targets))
    assert group.everyone is world
    assert group.comm.allgather(group.mine) == [group.mine] * group.comm.size
    assert world.allreduce(len(group.mine) if group.leads else 0) == targets
    # a communicator is a scarce resource, and what a dead one's matrices were is destroyed on it
    assert split(world, range(targets)).comm is group.comm


def test_targets_of_one_sample_share_a_group_and_links_at_rest_are_the_first_ones():
    groups = [split(World(rank, 2), [0, 1, 0, -1, 1, 2]) for rank in range(2)]
    assert [group.mine for group in groups] == [(0, 2, 3, 5), (1, 4)]
    assert split(World(0, 2), [-1, -1]).mine == (0, 1)
