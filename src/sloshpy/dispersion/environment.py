"""What a campaign's bits rest on besides its files: versions, the kernel of the linear algebra, the processor."""

import functools
import hashlib
import platform
import re
from importlib.metadata import version
from pathlib import Path


def environment() -> dict[str, str]:
    """Return names and versions that may change the last digits of a number."""
    import numpy as np

    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    return {
        "sloshpy": version("sloshpy"),
        "source": _source(),
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "scipy": version("scipy"),
        "numba": version("numba"),
        "blas": f"{blas.get('name', '')} {blas.get('version', '')}".strip(),
        "processor": _processor(),
    }


@functools.cache
def _source() -> str:
    """Return a hash of the package's own code: an edited copy of one version is another one."""
    folder = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _processor() -> str:
    """Return the family of the processor and the widest vectors it has, by which libraries choose their kernels."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return f"{platform.machine()} {platform.processor()}".strip()
    found = {
        key: re.search(rf"^{key}\s*:\s*(.+)$", text, re.M) for key in ("vendor_id", "cpu family", "model", "flags")
    }
    said = [m.group(1) for key, m in found.items() if m is not None and key != "flags"]
    flags = found["flags"].group(1).split() if found["flags"] is not None else []
    widest = next((name for name in ("avx512f", "avx2", "avx", "sse2") if name in flags), "")
    return " ".join([platform.machine(), *said, widest]).strip()
