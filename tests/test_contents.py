"""The package's table of contents: every public name, asked twice, before and after its room was imported."""

import subprocess
import sys
from types import ModuleType

import pytest

import sloshpy


@pytest.mark.parametrize("name", [name for name in sloshpy.__all__ if name != "__version__"])
def test_a_public_name_is_the_same_thing_each_time_and_no_module(name):
    first = getattr(sloshpy, name)
    assert getattr(sloshpy, name) is first
    assert not isinstance(first, ModuleType)


def test_the_verb_assess_survives_the_import_of_its_room():
    code = (
        "import sloshpy.assess; import sloshpy, sloshpy.cli; from sloshpy.assess import assess\n"
        "assert sloshpy.assess is assess and callable(sloshpy.assess)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_an_unknown_name_is_refused_by_name():
    with pytest.raises(AttributeError, match="asess"):
        sloshpy.asess  # noqa: B018
