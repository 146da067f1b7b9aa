"""What tests of several rooms ask for."""

import pytest

from sloshpy.cli import main


@pytest.fixture
def run(capsys):
    """The command line: exit status, what it printed and what it complained of."""

    def call(*words):
        with pytest.raises(SystemExit) as stopped:
            main([str(word) for word in words])
        printed = capsys.readouterr()
        return stopped.value.code, printed.out, printed.err

    return call
