"""Who is in a shot: the pose network, and identities."""
