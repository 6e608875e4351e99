"""Where the handles of a link go: to its joints, and to regular arc lengths of the spline between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenicsmech.design.handles import BETWEEN, LinkHandles
from fenicsmech.design.insertion import pierced
from fenicsmech.design.spline_fit import SplineFit
from fenicsmech.errors import DescriptionError
from fenicsmech.meshing import FREE, LinkMesh, plan_of

_CLEARANCE = 0.25  # of the spacing, between an intermediary handle and an interface
_SAMPLES = 1000  # of arc length, per segment


def place_handles(
    mesh: LinkMesh, fit: SplineFit, *, spacing: float, turns: Sequence[bool], part: str = "link"
) -> LinkHandles:
    """The handles of one link; intermediary ones in or next to an interface are left out.

    Args:
        mesh: the link's mesh.
        fit: its spline; sites are the interfaces of ``mesh``.
        spacing: arc length between handles, adjusted so that it divides each span between joints evenly.
        turns: whether each site may turn, (sites,).
        part: the link's name, for messages.

    Raises:
        DescriptionError: the spline leaves the link.
    """
    spline, plan = fit.spline, plan_of(mesh).mesh
    samples = np.linspace(0.0, spline.segments, _SAMPLES * spline.segments + 1)
    curve = spline.evaluate(spline.initial, samples)[:, :2]
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    held = plan.points[np.unique(plan.cells[plan.interface != FREE])][:, :2]

    joints = np.flatnonzero(spline.is_joint).astype(float)
    t, site = [joints[0]], [fit.sites[0]]
    for start, end, end_site in zip(joints, joints[1:], fit.sites[1:], strict=False):
        a, b = np.interp([start, end], samples, arc)
        parts = max(2, round((b - a) / spacing))
        between = np.interp(np.linspace(a, b, parts + 1)[1:-1], arc, samples)
        for candidate, at in zip(between, spline.evaluate(spline.initial, between)[:, :2], strict=True):
            cells, _ = pierced(plan, at)
            if len(cells) == 0:
                where = ", ".join(f"{c:g}" for c in at)
                raise DescriptionError(
                    f"spline of {part}", f"it leaves the link at ({where})", "Give a centreline inside the link"
                )
            clear = np.linalg.norm(held - at, axis=1).min() > _CLEARANCE * (b - a) / parts
            if clear and np.all(plan.interface[cells] == FREE):
                t.append(candidate)
                site.append(BETWEEN)
        t.append(end)
        site.append(end_site)
    site = np.array(site)
    return LinkHandles(spline, np.array(t), site, (site != BETWEEN) & np.array(turns)[site])
