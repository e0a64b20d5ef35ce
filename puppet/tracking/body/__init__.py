"""One performer's body: from landmarks to joints and their states."""
