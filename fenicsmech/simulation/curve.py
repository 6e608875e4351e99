"""A load–displacement curve: the frames of one configuration under one changing force, or one moving motor."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from fenicsmech.errors import DescriptionError
from fenicsmech.files import write_csv
from fenicsmech.mechanism import Configuration, Drive, Force, Leader, Motor, Units
from fenicsmech.multibody import Freedom
from fenicsmech.plot import CurveSeries, plot_curve
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.goal import Goal
from fenicsmech.simulation.request import Axis, axes


@dataclass(frozen=True, eq=False)
class Curve:
    """Frames of one configuration.

    Attributes:
        part: the force that changes, or the motors that move.
        configuration: motor positions.
        freedom: mobility and redundancy of the assembled configuration.
        frames: one per sample, in the order asked for.
        units: of the scene, for labels.
        leads: whether this process writes files.
        others: constant magnitudes of other forces.
        goal: what the samples leave open: displacements, or forces where displacements were prescribed.
        corrections: what ``displacements``, or ``forces`` where they are the goal, have more than the frames: estimates
            of what finer elements and space would add. Only where the fidelity was chosen by an accuracy, else empty.
    """

    part: Leader
    configuration: Configuration
    freedom: Freedom
    frames: tuple[Frame, ...]
    units: Units
    leads: bool
    others: tuple[tuple[Force, float], ...] = ()
    goal: Goal = Goal.DISPLACEMENT
    corrections: tuple[float, ...] = ()

    @property
    def force_part(self) -> Force:
        """The force that changes.

        Raises:
            DescriptionError: a motor leads the curve.
        """
        if not isinstance(self.part, Force):
            raise DescriptionError(
                f"curve of {self.part.name!r}", "no force leads it", "Ask this of a curve under a changing force"
            )
        return self.part

    @property
    def motor_part(self) -> Motor | Drive:
        """The motor, or motors that move together, whose position changes.

        Raises:
            DescriptionError: a force leads the curve.
        """
        if isinstance(self.part, Force):
            raise DescriptionError(
                f"curve of {self.part.name!r}", "no motor leads it", "Ask this of a curve that follows a motor"
            )
        return self.part

    @property
    def axes(self) -> tuple[Axis, Axis]:
        """What lies across and up on plots."""
        return axes(self.part, self.units)

    @property
    def forces(self) -> np.ndarray:
        """(frames,)."""
        return self._corrected(Goal.FORCE, [frame.force for frame in self.frames])

    @property
    def displacements(self) -> np.ndarray:
        """(frames,)."""
        return self._corrected(Goal.DISPLACEMENT, [frame.displacement for frame in self.frames])

    @property
    def goals(self) -> np.ndarray:
        """What the samples leave open, (frames,)."""
        return self.forces if self.goal is Goal.FORCE else self.displacements

    @property
    def stable(self) -> np.ndarray:
        """(frames,)."""
        return np.array([frame.stable for frame in self.frames])

    @property
    def jumped(self) -> np.ndarray:
        """Whether the mechanism snapped on the way to each frame, (frames,)."""
        return np.array([frame.jumped for frame in self.frames])

    def series(self, label: str = "", *, colour: str | None = None, faint: bool = False) -> CurveSeries:
        """The curve as a plot draws it, arguments as those of ``CurveSeries``."""
        return CurveSeries(
            self.displacements,
            self.forces,
            label=label,
            stable=self.stable,
            colour=colour,
            faint=faint,
            jumped=self.jumped,
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """Where the mechanism snapped and which equilibria are unstable, a sentence each."""
        (across, up), name, said = self.axes, self.configuration.name, []
        for before, after in pairwise((None, *self.frames)):
            if after.jumped:
                since = "on the way there" if before is None else f"after {up.quantity} {up(before.force)}"
                said.append(
                    f"{name}: snaps {since}, to {across.quantity} {across(after.displacement)} at {up.quantity} "
                    f"{up(after.force)}, which is one of perhaps several equilibria beyond the fold"
                )
        unstable = int(np.sum(~self.stable))
        if unstable:
            said.append(f"{name}: {unstable} of {len(self.frames)} equilibria are unstable under dead loads")
        return tuple(said)

    def plot(self, path: str | Path) -> None:
        """Draws the curve as a PNG (rank 0)."""
        if self.leads:
            across, up = self.axes
            plot_curve(
                Path(path),
                [self.series()],
                xlabel=across.label,
                ylabel=up.label,
                title=f"{self.part.name}, {self.configuration.name}",
            )

    def write_csv(self, path: str | Path, *, errors: np.ndarray | None = None) -> None:
        """Writes displacement, force, stability, energy and stress of every frame (rank 0).

        Args:
            path: the file.
            errors: what finer elements would add to displacements, or to forces where displacements were prescribed
                (``goal``), (frames,), for a column of their own.
        """
        length, force, stress = self.units.length, self.units.force, self.units.stress
        if self.leads:
            across, up = self.axes
            columns = {
                across.label: self.displacements,
                up.label: self.forces,
                "stable": self.stable,
                "jumped": self.jumped,
                f"strain energy [{force} {length}]": np.array([frame.strain_energy for frame in self.frames]),
                f"max von Mises [{stress}]": np.array([frame.max_stress for frame in self.frames]),
            }
            unit = force if self.goal is Goal.FORCE else length
            if self.corrections:
                columns[f"correction within the {self.goal.value} [{unit}]"] = np.array(self.corrections)
            if errors is not None:
                columns[f"finer elements add to the {self.goal.value} [{unit}]"] = errors
            write_csv(Path(path), columns)

    def _corrected(self, goal: Goal, values: list[float]) -> np.ndarray:
        corrected = self.corrections and goal is self.goal
        return np.array(values) + np.array(self.corrections) if corrected else np.array(values)
