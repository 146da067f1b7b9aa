"""The whole review of one case: margins, danger zone, required damping, limit cycles, and one verdict with reasons."""

from sloshpy.assess.assessment import Assessment, TankReview
from sloshpy.assess.review import assess

__all__ = ["Assessment", "TankReview", "assess"]
