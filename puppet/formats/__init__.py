"""Foreign files to armatures, skins and skeleton frames."""
