"""What the tests of files share."""

from pathlib import Path

import pytest
from good_case import GOOD, Refuse

from sloshpy.errors import InputError, Problem
from sloshpy.files import read_case


@pytest.fixture
def refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Refuse:
    """Spoil the sound case file by replacing texts in it and return the problems that reading it tells."""
    monkeypatch.chdir(tmp_path)

    def spoil(*replacements: tuple[str, str], text: str | bytes = GOOD) -> list[Problem]:
        for old, new in replacements:
            assert isinstance(text, str)
            assert old in text
            text = text.replace(old, new, 1)
        Path("case.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
        with pytest.raises(InputError) as caught:
            read_case("case.toml")
        assert all(problem.cure for problem in caught.value.problems)
        return list(caught.value.problems)

    return spoil
