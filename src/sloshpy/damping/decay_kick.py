"""A search for the moment at which a free decay was disturbed: amplitude and phase that jump."""

import numpy as np

from sloshpy.damping.decay_model import log_envelope_and_phase, ratio_at, wave
from sloshpy.damping.decay_noise import Noise
from sloshpy.damping.decay_record import DecayRecord
from sloshpy.damping.decay_tangent import Tangent
from sloshpy.units import Array

_PER_CYCLE = 4  # moments looked at
_INDEPENDENT = 2.0  # of them: what the greatest of all is like in white noise, between 8 and 60 cycles
_MOST_MOMENTS = 800
_FALSE_ALARM = 0.01  # of a record without a kick; a smaller one lets kicks through that bend the damping by 10 %
# of the amplitude: what the averaging leaves stays below it and 0.2 xi^2, and moves the damping by less than its band
_LEAST_JUMP = 0.005


def check_kick(record: DecayRecord, tangent: Tangent, noise: Noise) -> None:
    """Refuse a record whose wave jumps at some moment by more than its noise explains, whatever the law.

    A kick at t_k adds to the wave, from then on, a change of amplitude that dies as the fitted law says, and one of
    phase. Each moment's two columns are freed of what the law and the linear numbers could follow, and the residual's
    share in them follows, without a kick, an F distribution of two degrees of freedom.
    """
    fit = tangent.fit
    moments, evidence, jump = kick_evidence(tangent)
    if fit.exact or not len(moments):
        return
    cycles = fit.values[0, 0] * fit.time[-1] / (2.0 * np.pi)
    chance = _FALSE_ALARM / max(_INDEPENDENT * cycles, 1.0)
    power = noise.power(2.0 * np.pi * cycles / (len(fit.time) - 1))
    free = max(len(fit.time) * min(float(np.var(fit.residual)) / power, 1.0) - tangent.columns.shape[1], 2.0)
    limit = free * (chance ** (-2.0 / free) - 1.0)  # of twice F with 2 and `free` degrees of freedom
    most = float(ratio_at(fit.values[0], np.ones(1))[0])
    found = np.where(jump > _LEAST_JUMP + 0.2 * most**2, evidence / power, 0.0)
    k = int(np.argmax(found))
    if found[k] > limit:
        at = int(moments[k])
        value = f"the wave jumps by {100.0 * jump[k]:.3g} % at {record.time[at]:.4g} s"
        rule = f"a free decay has no jump, and this one is {np.sqrt(found[k]):.3g} times its standard error"
        cure = "name the part before or after it by --start and --end, or repeat the test undisturbed"
        raise record.refused(value, rule, cure, at)


def kick_evidence(tangent: Tangent) -> tuple[Array, Array, Array]:
    """Return moments, as samples; the residual's share in a kick at each, a sum of squares; and its jump.

    The jump is of the wave's complex amplitude, over the amplitude at that moment.
    """
    fit = tangent.fit
    n = len(fit.time)
    cycles = fit.values[0, 0] * fit.time[-1] / (2.0 * np.pi)
    count = int(min(_PER_CYCLE * cycles, _MOST_MOMENTS))
    moments = np.unique(np.linspace(0, n, count + 2)[1:-1].astype(int))
    log_a, _ = log_envelope_and_phase(fit.values[0], fit.time)
    ratio = ratio_at(fit.values[0], np.exp(log_a))
    mode = wave(fit.values[0], fit.time) * (fit.coefficient[0] - 1j * fit.coefficient[1])
    Z = np.stack([mode.real * ratio, mode.imag], axis=1)
    size = np.linalg.norm(Z, axis=0)
    Z = Z / size
    basis = tangent.basis
    later = np.concatenate([basis, tangent.residual[:, None], Z], axis=1)
    # sums from a moment on, of each column times each of Z
    sums = np.stack([np.cumsum((later * z[:, None])[::-1], axis=0)[::-1][moments] for z in Z.T], axis=2)
    followed, share, gram = sums[:, : basis.shape[1]], sums[:, -3], sums[:, -2:]
    free = gram - np.einsum("mci,mcj->mij", followed, followed)
    # nothing is left to see of a jump in the first or last cycle, which is the decay's own start or end
    seen = np.linalg.eigvalsh(free)[:, 0] > 1e-6
    free, share, moments = free[seen], share[seen], moments[seen]
    answer = np.linalg.solve(free, share[:, :, None])[:, :, 0]
    evidence = np.sum(share * answer, axis=1)
    jump = np.hypot(answer[:, 0] / size[0] * ratio[moments], answer[:, 1] / size[1])
    return moments, np.asarray(evidence), np.asarray(jump)
