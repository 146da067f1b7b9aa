"""Why a case has no answer, in one line."""

from pydantic import ValidationError

MOST_REASON = 200  # characters kept


def reason_of(error: Exception) -> str:
    """Return what an error says, that of a noun with the place of the fault."""
    if isinstance(error, ValidationError):
        one = error.errors(include_url=False)[0]
        where = " ".join(str(step) for step in (*one["loc"], *one.get("ctx", {}).get("key", ())))
        return f"{where} {one['msg']}".strip()[:MOST_REASON]
    return (" ".join(str(error).split()) or type(error).__name__)[:MOST_REASON]
