"""Health of nodes: rates, latencies and levels of this node, and the known state of all others.

A node sends its diagnostics once a second. If ``ZV_HEALTH_FILE`` names a file, the node also
writes ``ok`` to it, or the failure: the loop has been in the same iteration for 5 s, or the source
is gone. A node that waits for its router, or receives nothing, is healthy. A container's health
check reads the file's age and first word. This needs no interpreter, and it also detects a frozen
process, which no longer writes the file.
"""
