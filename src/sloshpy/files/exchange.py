"""Exchange with python-control: loops out as state space, designed filters in."""

from typing import TYPE_CHECKING

import numpy as np

from sloshpy.autopilot import DigitalFilter, Filter
from sloshpy.dynamics import FrequencyResponse, Loop
from sloshpy.dynamics.sensed import fed
from sloshpy.dynamics.states import controller
from sloshpy.errors import OutsideValidity

if TYPE_CHECKING:
    import control


def to_control(loop: Loop) -> "control.StateSpace":
    """Return one loop as a python-control state space from engine command to -(beta fed back): L(s), negative feedback.

    Drift is removed by structure, so that no spurious crossing at zero frequency is found. A delay becomes its Pade
    approximation of order 8, which state space needs; `response_to_control` keeps it exact. A digital autopilot is
    refused.
    """
    import control  # 2 to 5 s: only when an exchange is wanted

    if loop.batch:
        raise ValueError("give one loop, not a batch; take one with `loop.take`")
    if loop.autopilot.sample_time is not None:
        raise OutsideValidity("a digital autopilot has no continuous state space; hand over its response instead")
    p = fed(loop)
    A_c, B_c, C_c, D_c, _ = controller(loop)
    n, k = p.A.shape[0], A_c.shape[0]
    # broken before the forward path: command in, beta and beta'' from it, what the autopilot is fed out
    direct, through, felt = np.outer(p.B, D_c), np.outer(p.B, C_c), p.d * C_c
    if np.any(p.B2) or np.any(p.d2):  # an actuator stands before the engine: beta'' = C A^2 x + C A B u
        direct, through = direct + np.outer(p.B2, C_c @ A_c @ B_c), through + np.outer(p.B2, C_c @ A_c @ A_c)
        felt = felt + p.d2 * (C_c @ A_c @ A_c)
    A = np.block([[p.A, through], [np.zeros((k, n)), A_c]])
    B = np.concatenate([direct, B_c[:, None]])
    C = -np.concatenate([p.c, felt])[None, :]
    return control.ss(A, B, C, 0.0, inputs=["engine"], outputs=["loop"], name="slosh_loop")


def response_to_control(response: FrequencyResponse) -> "control.FrequencyResponseData":
    """Return a frequency response of one loop as python-control FRD; the delay in it is exact."""
    import control  # as above

    if response.loop.ndim != 1:
        raise ValueError("give the response of one loop, not of a batch")
    return control.frd(response.loop, response.omega)


def from_control(system: "control.lti.LTI") -> Filter | DigitalFilter:
    """Return a single-input single-output python-control system as an autopilot filter, a discrete one as a digital.

    A discrete system's period must be the autopilot's sample_time; a filter does not carry it.

    Raises:
        ValueError: several inputs or outputs, improper, or of an order above 10, where polynomial
            coefficients lose their digits.
    """
    import control  # as above

    if not isinstance(system, control.TransferFunction | control.StateSpace):
        raise ValueError(f"is a {type(system).__name__}; give a transfer function or a state space")
    if not system.issiso():
        raise ValueError(f"has {system.ninputs} inputs and {system.noutputs} outputs; give a filter with one of each")
    transfer = control.tf(system)
    top, bottom = np.trim_zeros(transfer.num[0][0], "f"), np.trim_zeros(transfer.den[0][0], "f")
    if len(bottom) > 11:
        raise ValueError(f"has order {len(bottom) - 1}; split it into filters of order 10 at most")
    kind = DigitalFilter if system.isdtime(strict=True) else Filter
    return kind(numerator=tuple(map(float, top)), denominator=tuple(map(float, bottom)))
