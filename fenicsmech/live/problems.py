"""What the page says of errors, snaps, unstable equilibria and ends: each problem with its remedy."""

from __future__ import annotations

from fenicsmech.design import DesignResult
from fenicsmech.equilibrium import Unknown
from fenicsmech.errors import FenicsmechError
from fenicsmech.simulation import Curve

_SNAPPED = "Make the largest force smaller to stay before the snap, or let the links be thicker"
_UNSTABLE = "What is dashed stays only where something holds its displacement"
_MISSED = "Relax a target, widen the thicknesses, or move a joint"
_MET = 0.01  # relative error of a target


def explained(error: FenicsmechError) -> dict[str, str]:
    """An error as plain data."""
    return {"part": error.part, "problem": error.problem, "remedy": error.remedy}


def too_long(seconds: float) -> dict[str, str]:
    """A solve whose time is over."""
    remedy = "Choose larger elements, fewer frames or smaller loads, and solve again; what was found before stays"
    return {
        "part": "time limit",
        "problem": f"the solve takes longer than {seconds:g} s and was ended",
        "remedy": remedy,
    }


def remarks(curve: Curve) -> list[str]:
    """The remarks of a curve, a sentence each with its remedy."""
    dashed = _UNSTABLE if curve.unknown is Unknown.FORCE else f"Make the largest force smaller. {_UNSTABLE}"
    remedies = [_SNAPPED] * sum(frame.snapped_through for frame in curve.frames) + [dashed]
    return [f"{own}. {remedy}." for own, remedy in zip(curve.remarks, remedies, strict=False)]


def missed(result: DesignResult) -> dict[str, str] | None:
    """Targets out of reach, and optimisations that ended early; None if all is well."""
    worst = max(abs(target.error) for target in result.targets)
    if worst > _MET:
        return {"problem": f"targets are missed by up to {100 * worst:.2g} %: {result.reason}", "remedy": _MISSED}
    if not result.converged:
        return {"problem": f"targets are met within {100 * worst:.2g} %, but {result.reason}", "remedy": _MISSED}
    return None
