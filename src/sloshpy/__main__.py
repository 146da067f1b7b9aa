"""`python -m sloshpy` is `sloshpy`."""

from sloshpy.cli import main

main()
