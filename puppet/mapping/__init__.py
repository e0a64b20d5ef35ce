"""How a human body drives an armature: scores, assignment, drive."""
