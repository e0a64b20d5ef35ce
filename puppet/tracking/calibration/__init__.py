"""Where cameras stand: the floor, the stage, boards, and what is saved."""
