"""How much of the Earth's gravity field a truth has, or a filter believes in."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FieldExtent:
    """Which harmonics of a gravity field there are.

    Attributes:
        degree: The highest degree; below 2 for a point mass.
        order: The highest order; 0 for zonal harmonics alone.
        model: The field's name; "" for the campaign's own constants.

    Examples:
        >>> FieldExtent(4).covers(FieldExtent(2)), FieldExtent(4).covers(FieldExtent(20, 20, "ggm05s"))
        (True, False)
        >>> str(FieldExtent(20, 20, "ggm05s"))
        'ggm05s, 20 x 20'
    """

    degree: int
    order: int = 0
    model: str = ""

    def covers(self, other: FieldExtent) -> bool:
        """Return whether the other field has nothing that this one lacks.

        Zonal harmonics count as the same in all models of a body; those that depend on longitude only in the same
        model, since two models are what a campaign may compare.
        """
        same = other.order == 0 or self.model == other.model
        return same and self.degree >= other.degree and self.order >= other.order

    def __str__(self) -> str:
        if self.model:
            return f"{self.model}, {self.degree} x {self.order}"
        if self.degree < 2:
            return "a point mass"
        return "J2" if self.degree == 2 else f"J2 to J{self.degree}"
