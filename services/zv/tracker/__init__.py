"""The tracker: finds all moving objects of each frame, or the largest one as the tutorial does."""
