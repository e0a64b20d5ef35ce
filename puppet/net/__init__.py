"""The bus, its messages, and the processes that meet on it."""
