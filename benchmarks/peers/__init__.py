"""Capture to decoded frame of this system beside others, in one run with the same frames."""
