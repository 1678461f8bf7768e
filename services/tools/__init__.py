"""The tools: programs that look at a running system, one folder each, and what they share."""
