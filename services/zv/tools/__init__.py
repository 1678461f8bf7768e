"""The tools: programs that observe a running system, one folder each, and their shared modules."""
