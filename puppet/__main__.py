"""`python -m puppet`."""

from puppet.cli import main

main()
