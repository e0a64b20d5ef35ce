"""From raw joints to joints that may drive a puppet."""
