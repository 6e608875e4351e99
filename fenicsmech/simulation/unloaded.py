"""Where points of the unloaded mechanism are while motors move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenicsmech.errors import AssemblyError
from fenicsmech.mechanism import Configuration, Force, Output, in_dimension
from fenicsmech.multibody import Linkage, SpringPotential, assemble


def unloaded_positions(
    linkage: Linkage, part: Force | Output, configurations: Sequence[Configuration], holding: Sequence[SpringPotential]
) -> np.ndarray:
    """Positions of the point of a force or output in each configuration, (configurations, dim).

    Raises:
        AssemblyError: one of the configurations does not assemble, or its motors strain the links.
    """
    body = linkage.body_of(part.on)
    space, centre = linkage.joints.space, np.array(linkage.bodies[body].centre)
    drawn = np.array(in_dimension(part.at, linkage.dim))
    positions = []
    for configuration in configurations:
        assembly = assemble(linkage, configuration, holding)
        if assembly.fraction < 1.0:
            raise AssemblyError(
                f"configuration {configuration.name!r}",
                f"its motors strain the links beyond {assembly.fraction:.1%} of their way",
                "Use load_displacement with an output at the point",
            )
        positions.append(drawn + space.displace(assembly.poses[body], (drawn - centre)[None])[0])
    return np.array(positions)
