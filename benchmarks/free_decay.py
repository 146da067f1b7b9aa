"""Free decays with a known truth: bias and coverage over the amplitude, refusals, and kicks hidden in the noise.

    OPENBLAS_NUM_THREADS=1 python benchmarks/free_decay.py laws [RECORDS] [SEED]
    OPENBLAS_NUM_THREADS=1 python benchmarks/free_decay.py noise [RECORDS] [SEED]
    OPENBLAS_NUM_THREADS=1 python benchmarks/free_decay.py kicks [RECORDS] [SEED]
    OPENBLAS_NUM_THREADS=1 python benchmarks/free_decay.py beats [RECORDS] [SEED]

laws: 20 cycles of 16 samples, white noise of 1 % of the first amplitude, each law. noise: other levels and lengths, and
coloured noise. kicks: records of any law here, 8 to 40 cycles of 12 to 64 samples, noise of 0.1 to 3 %, undisturbed and
with a jump of the wave of 0.3 to 30 % of the first amplitude at a random moment; wrong is an answer that is off by more
than 5 % and 1.5 half bands somewhere. beats: two lines of one constant damping of 0.3 to 2 %, 0.3 to 30 % apart, the
second of 3 to 100 % of the first, 8 to 40 cycles of 16 samples, noise of 0.5 %; wrong is more than 5 % off and outside
the band somewhere. Tables are Markdown, for docs/decay.md. The seeds are not those of the tests.
"""

import sys
import time as clock
from collections import Counter
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from sloshpy.damping import DecayRecord, FreeDecay, free_decay
from sloshpy.damping.decay_model import wave
from sloshpy.errors import InputError

PLACES = [0, 6, 12, 18, 24]
LAWS = {  # w, xi0, q, p, k; q at the first sample
    "constant": [2.0, 0.01, 0.0, 1.0, 0.0],
    "power 1/2": [2.0, 0.0, 0.02, 0.5, 0.0],
    "power 0.7": [2.0, 0.0, 0.025, 0.7, 0.0],
    "power 1": [2.0, 0.0, 0.03, 1.0, 0.0],
    "power 1.5": [2.0, 0.0, 0.04, 1.5, 0.0],
    "sum 1/2": [2.0, 0.004, 0.02, 0.5, 0.0],
    "sum 1": [2.0, 0.005, 0.025, 1.0, 0.0],
    "sum 1.3": [2.0, 0.005, 0.03, 1.3, 0.0],
}


def identify(time: np.ndarray, value: np.ndarray, seed: int) -> FreeDecay | None:
    """Return what is found, None where it is refused."""
    try:
        return free_decay(DecayRecord(time=time, value=value, unit="m"), frequency_hint=2.0, seed=seed)
    except InputError:
        return None


def row(name: str, truth: list[float], noise: float, cycles: float, colour: float, records: int, seed: int) -> None:
    """Print one law's line: amplitude range, bias, rms error, half band and coverage at five amplitudes."""
    values, time = np.array(truth), np.arange(0.0, cycles * np.pi, 0.2)
    clean, table, began = wave(values, time), [], clock.process_time()
    for k in range(seed, seed + records):
        generator = np.random.default_rng(k)
        start = 0.1 * np.exp(2j * np.pi * generator.uniform())
        shocks = lfilter([1.0], [1.0, -colour], generator.standard_normal(len(time) + 200))[200:]
        shocks = shocks * np.sqrt(1.0 - colour**2)
        found = identify(time, np.real(clean * start) + 0.01 + 0.1 * noise * shocks, k)
        if found is None:
            continue
        A, xi = found.amplitude[PLACES], values[1] + values[2] * (found.amplitude[PLACES] / 0.1) ** values[3]
        low, high = found.ratio_low[PLACES], found.ratio_high[PLACES]
        held = (low <= xi) & (xi <= high)
        f = found.estimates[0]
        whole = np.full(5, f.low <= values[0] <= f.high)
        table.append([A / 0.1, found.ratio[PLACES] / xi - 1.0, 0.5 * (high - low) / xi, held, whole])
    spent = 1e3 * (clock.process_time() - began) / records
    refused = 100.0 * (1.0 - len(table) / records)
    if not table:
        print(f"| {name} | {100 * noise:g} % | {cycles:g} | | | | | | {refused:.1f} % | {spent:.0f} |", flush=True)
        return
    A, error, half, held, whole = np.mean(table, axis=0)
    scatter = np.sqrt(np.mean(np.square(np.array(table)[:, 1]), axis=0))
    cells = [
        " ".join(f"{100.0 * x:.{digits}f}" for x in part)
        for part, digits in ((error, 1), (scatter, 1), (half, 1), (held, 1))
    ]
    ends = f"{A[0]:.2f}-{A[-1]:.2f}"
    line = [
        name,
        f"{100 * noise:g} %",
        f"{cycles:g}",
        ends,
        *cells,
        f"{100 * whole[0]:.1f}",
        f"{refused:.1f} %",
        f"{spent:.0f}",
    ]
    print("| " + " | ".join(line) + " |", flush=True)


def heading() -> None:
    """Print the head of the table of laws."""
    names = ["law", "noise", "cycles", "A/A0", "bias %", "rms error %", "half band %", "inside %"]
    names += ["frequency inside %", "refused", "ms"]
    print("| " + " | ".join(names) + " |\n|" + " --- |" * len(names))


def kicked(generator: np.random.Generator, kick: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, record and the law's numbers of a random record, disturbed or not."""
    values = np.array(list(LAWS.values())[generator.integers(len(LAWS))])
    noise, jump = 10.0 ** generator.uniform(-3.0, -1.5), 10.0 ** generator.uniform(-2.5, -0.5)
    cycles, samples = int(generator.integers(8, 41)), int(generator.choice([12, 16, 32, 64]))
    values[1:3] *= 20.0 / cycles * generator.uniform(0.5, 1.5)
    time = np.arange(0.0, cycles * np.pi, np.pi / samples)
    z = wave(values, time)
    at = int(np.searchsorted(time, generator.uniform(0.1, 0.9) * time[-1]))
    there = z[at] + jump * kick * np.exp(2j * np.pi * generator.uniform())
    after = values.copy()
    after[2] *= abs(there) ** values[3]  # q is the part of the damping at the amplitude of its first sample
    z = np.concatenate([z[:at], there * wave(after, time[at:] - time[at])])
    value = 0.1 * np.real(z * np.exp(2j * np.pi * generator.uniform()))
    return time, value + 0.1 * noise * generator.standard_normal(len(time)), values


def kicks(records: int, seed: int) -> None:
    """Print how many undisturbed and disturbed records are refused, answered, and answered wrongly."""
    print("| record | refused | answered within the band | outside, right to 5 % or 1.5 half bands | wrong | worst |")
    print("|" + " --- |" * 6)
    for kick in (False, True):
        count: Counter[str] = Counter()
        worst = 0.0
        for k in range(seed, seed + records):
            time, value, values = kicked(np.random.default_rng(k), kick)
            found = identify(time, value, k)
            if found is None:
                count["refused"] += 1
                continue
            xi = values[1] + values[2] * (found.amplitude / 0.1) ** values[3]
            half, error = 0.5 * (found.ratio_high - found.ratio_low) / xi, np.abs(found.ratio / xi - 1.0)
            held = np.all((found.ratio_low <= xi) & (xi <= found.ratio_high))
            wrong = np.any((error > 0.05) & (error > 1.5 * half))
            worst = max(worst, float(np.max(error)))
            count["held" if held else "wrong" if wrong else "near"] += 1
        cells = [f"{100.0 * count[name] / records:.1f} %" for name in ("refused", "held", "near", "wrong")]
        print(
            f"| {'kicked' if kick else 'undisturbed'} | " + " | ".join(cells) + f" | {100 * worst:.0f} % |", flush=True
        )


def two_lines(generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return time, record, damping and the beats in the record of two lines of one damping."""
    xi, apart = generator.uniform(0.003, 0.02), generator.choice([0.003, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3])
    share, cycles = generator.choice([0.03, 0.1, 0.3, 0.6, 1.0]), int(generator.choice([8, 15, 25, 40]))
    ratio = 1.0 + apart * generator.choice([-1.0, 1.0])
    time = np.arange(0.0, cycles * np.pi, np.pi / 16)
    turns = generator.uniform(0.0, 2.0 * np.pi, 2)
    value = sum(
        size * np.exp(-xi * w * time) * np.cos(w * time + turn)
        for size, w, turn in zip((1.0, share), (2.0, 2.0 * ratio), turns, strict=True)
    )
    return time, 0.2 * (value + 0.005 * generator.standard_normal(len(time))), float(xi), float(apart * cycles)


def beats(records: int, seed: int) -> None:
    """Print, by the beats in a record, how many records of two lines are refused, right and wrong, and the worst."""
    edges = [0.0, 0.1, 0.25, 0.5, 1.0, 2.0, np.inf]
    count: Counter[tuple[int, str]] = Counter()
    worst = np.zeros(len(edges) - 1)
    for k in range(seed, seed + records):
        time, value, xi, whole = two_lines(np.random.default_rng(k))
        place = int(np.searchsorted(edges, whole, side="right")) - 1
        found = identify(time, value, k)
        if found is None:
            count[place, "refused"] += 1
            continue
        error = float(np.max(np.abs(found.ratio / xi - 1.0)))
        held = np.all((found.ratio_low <= xi) & (xi <= found.ratio_high))
        count[place, "wrong" if error > 0.05 and not held else "right"] += 1
        worst[place] = max(worst[place], error)
    print("| beats in the record | records | refused | right | wrong | worst |\n|" + " --- |" * 6)
    for place, (low, high) in enumerate(pairwise(edges)):
        cells = [count[place, name] for name in ("refused", "right", "wrong")]
        print(
            f"| {low:g} to {high:g} | {sum(cells)} | "
            + " | ".join(map(str, cells))
            + f" | {100 * worst[place]:.0f} % |"
        )


def main() -> None:
    """Print the table that is asked for."""
    what = sys.argv[1] if len(sys.argv) > 1 else "laws"
    records = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 10_000_000
    if what == "kicks":
        kicks(records, seed)
        return
    if what == "beats":
        beats(records, seed)
        return
    heading()
    if what == "laws":
        for name, truth in LAWS.items():
            row(name, truth, 0.01, 20.0, 0.0, records, seed)
        return
    for name in ("constant", "power 1", "sum 1"):
        for noise, cycles, colour in ((0.001, 20.0, 0.0), (0.03, 20.0, 0.0), (0.01, 8.0, 0.0), (0.01, 60.0, 0.0)):
            row(name, LAWS[name], noise, cycles, colour, records, seed)
    row("sum 1, noise of time constant 1.9 s", LAWS["sum 1"], 0.01, 20.0, 0.9, records, seed)


if __name__ == "__main__":
    main()
