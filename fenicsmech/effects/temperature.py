"""Temperature: links that expand freely as they get warmer.

    F_p = (1 + σ α ΔT) I

with the coefficient of linear expansion α of the link's material, the change of its temperature ΔT and the load factor
σ. Elastic constants stay as they are. The strain energy is that of ``prestrain``, and both factors multiply: a link
that has both is λ (1 + α ΔT) times as long without strain. In plane strain the depth may not follow, which stresses the
link.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fenicsmech.elasticity import Stretch
from fenicsmech.errors import DescriptionError, expect, finite, set_fields
from fenicsmech.mechanism import Effect, FlexibleLink


@dataclass(frozen=True)
class Temperature(Effect):
    """A change of temperature of flexible links, whose materials need their ``expansion``.

    Rigid links and interfaces keep their size.

    Attributes:
        change: ΔT in K: one of all ``links``, one of each, or a mapping {link: ΔT, …}.
        links: flexible links; None: all of the mechanism.

    Raises:
        DescriptionError: the links are not flexible links, one is named twice, or there is not one finite change for
            all or for each; when it is simulated: the expansion of a material is not known, or a link of no length
            would be left.
    """

    change: float | Sequence[float] | Mapping[FlexibleLink, float]
    links: FlexibleLink | Sequence[FlexibleLink] | None = None

    def __post_init__(self) -> None:
        part, change, links = "temperature", self.change, self.links
        if isinstance(change, Mapping):
            if links is not None:
                raise DescriptionError(part, "its links are given twice", "Give {link: change, …} alone")
            links, change = tuple(change), tuple(change.values())
        if isinstance(links, FlexibleLink):
            links = (links,)
        if links is not None:
            links = tuple(links)
            for link in links:
                expect(part, link, FlexibleLink, "a flexible link", "Give flexible links: rigid ones keep their size")
            if not links or len(set(links)) < len(links):
                names = [link.name for link in links]
                raise DescriptionError(part, f"its links are {names}", "Name at least one, and each once")
        if isinstance(change, Sequence) and not isinstance(change, str):
            if links is None or len(change) != len(links):
                raise DescriptionError(part, f"{change!r} is not a change of each link", "Give {link: change, …}")
            change = tuple(
                finite(f"temperature of {link.name!r}", own) for link, own in zip(links, change, strict=True)
            )
        else:
            change = finite(part, change)
        set_fields(self, change=change, links=links)

    def changes(self, links: Sequence[FlexibleLink]) -> dict[FlexibleLink, float]:
        """ΔT of those among the flexible ``links`` of a mechanism whose temperature changes. *Local.*"""
        chosen: Sequence[FlexibleLink] = links if self.links is None else self.links  # type: ignore[assignment]
        if isinstance(self.change, tuple):
            return dict(zip(chosen, self.change, strict=True))
        return dict.fromkeys(chosen, self.change)  # type: ignore[arg-type]  # a number, else

    def check(self, mechanism, dim):
        flexible = mechanism.flexible_links
        for link, change in self.changes(flexible).items():
            if link not in flexible:
                problem = f"{link!r} is not a flexible link of {mechanism.name!r}"
                raise DescriptionError("temperature", problem, "Name links of the mechanism")
            self.check_change(link, change)

    @staticmethod
    def check_change(link: FlexibleLink, change: float) -> None:
        """Raises a DescriptionError if the expansion of a link is not known, or a ``change`` in K leaves no length."""
        if (expansion := link.material.expansion) is None:
            raise DescriptionError(
                f"material {link.material.name!r}",
                f"its thermal expansion is not known, and the temperature of link {link.name!r} changes",
                "Give it expansion=… in 1/K, or name the links that get warmer: Temperature(change, links=…)",
            )
        if expansion * change <= -1.0:
            problem = f"{change:g} K and an expansion of {expansion:g}/K leave no length"
            raise DescriptionError(f"temperature of {link.name!r}", problem, "Give a smaller change, in K")

    def explain(self):
        if self.links is None:
            return f"free thermal expansion of all flexible links by {self.change:+g} K"
        each = ", ".join(f"{link.name} by {change:+g} K" for link, change in self.changes(()).items())
        return f"free thermal expansion of {each}"

    def growth(self, model, links):
        changes = self.changes(links).items()
        return {link: Stretch(1.0 + link.material.expansion * change, None) for link, change in changes}
