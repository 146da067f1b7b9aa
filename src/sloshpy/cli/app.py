"""The application that every command joins."""

from importlib.metadata import version

import cyclopts

app = cyclopts.App(
    name="sloshpy",
    version=version("sloshpy"),
    help="Decide whether propellant slosh and a rocket's autopilot get along.",
    help_format="plaintext",
)
