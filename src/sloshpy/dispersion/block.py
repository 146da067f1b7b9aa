"""The bytes of a block of cases, on disk and on the wire: no code in them, and proved to the last byte.

`sloshpy block 1`, one line of JSON, the rows as little-endian float64, and the SHA-256 of all of it.
"""

import hashlib
import json

import numpy as np

from sloshpy.dispersion.rows import Rows

_MAGIC = b"sloshpy block 1\n"
_DIGEST = 32  # bytes of SHA-256


def encoded(number: int, rows: Rows, campaign: str) -> bytes:
    """Return the bytes of a block; `campaign` says what it belongs to."""
    table = np.column_stack([np.arange(rows.first, rows.first + rows.count), rows.status, rows.values])
    payload = np.ascontiguousarray(table, dtype="<f8").tobytes()
    told = {str(rows.first + k): reason for k, reason in enumerate(rows.reasons) if reason}
    head = {
        "campaign": campaign,
        "number": number,
        "shape": table.shape,
        "payload": len(payload),
        "reasons": told,
    }
    body = _MAGIC + json.dumps(head, sort_keys=True).encode() + b"\n" + payload
    return body + hashlib.sha256(body).digest()


def decoded(data: bytes, number: int, campaign: str) -> Rows | None:
    """Return the rows of a block file, None where any bit is not as written or it is another campaign's."""
    body, digest = data[:-_DIGEST], data[-_DIGEST:]
    if not body.startswith(_MAGIC) or hashlib.sha256(body).digest() != digest:
        return None
    line, _, payload = body[len(_MAGIC) :].partition(b"\n")
    try:
        head = json.loads(line)
        if (head["campaign"], head["number"], head["payload"]) != (campaign, number, len(payload)):
            return None
        table = np.frombuffer(payload, dtype="<f8").reshape(head["shape"]).astype(float)
        first, told = int(table[0, 0]), dict(head["reasons"])
    except (ValueError, KeyError, TypeError, IndexError, OverflowError):  # whole, but made by something else
        return None
    if table.ndim != 2 or not np.array_equal(table[:, 0], np.arange(first, first + len(table))):
        return None
    reasons = tuple(str(told.get(str(first + k), "")) for k in range(len(table)))
    return Rows(first=first, values=table[:, 2:].copy(), status=table[:, 1].copy(), reasons=reasons)
