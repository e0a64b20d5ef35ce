"""What the commands do, apart from reading their arguments (puppet/cli.py does that)."""
