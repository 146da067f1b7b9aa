"""Laws of damping as sums of powers of the slosh velocity, as the kernel of many runs takes them."""

import numpy as np

from sloshpy.batch import case_shape
from sloshpy.case import Case
from sloshpy.damping import ConstantDamping, PowerDamping
from sloshpy.errors import OutsideValidity
from sloshpy.simulation.law_terms import flattened
from sloshpy.units import Array


def power_terms(case: Case) -> tuple[Array, Array, Array]:
    """Return what each tank's law is made of: constant ratio (n,), and power terms c |v|^p v.

    Coefficients are (..., n, K), since c = c_1 w^(1 - p) follows the slosh frequency; exponents (n, K).

    Raises:
        OutsideValidity: a tabulated law, or one with an end of its validity.
    """
    constant, terms = [], []
    for tank in case.vehicle.tanks:
        ratio, powers = 0.0, []
        for part in flattened(tank.damping):
            if isinstance(part, ConstantDamping):
                ratio += part.constant_ratio
            elif isinstance(part, PowerDamping):
                if part.holds_to is not None:  # the kernel does not look where a law ends
                    raise OutsideValidity(
                        f"{tank.name} has a law that holds to {part.holds_to:g} m only: simulate each case"
                    )
                powers.append((part.coefficient(1.0), part.exponent))
            else:
                raise OutsideValidity(f"{tank.name} has a tabulated law: simulate each case")
        constant.append(ratio)
        terms.append(powers)
    most = max((len(t) for t in terms), default=0) or 1
    filled = np.array([[*t, *[(0.0, 1.0)] * (most - len(t))] for t in terms]).reshape(-1, most, 2)
    exponent = np.ascontiguousarray(filled[..., 1])
    w = [np.broadcast_to(np.asarray(tank.frequency, dtype=float), case_shape(case)) for tank in case.vehicle.tanks]
    at = np.stack(w, axis=-1)[..., None] if w else np.ones((0, 1))
    return np.array(constant), filled[..., 0] * at ** (1.0 - exponent), exponent
