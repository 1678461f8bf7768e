"""Zenoh: configuration, sessions, links to the router, publishers, subscriptions and queries.

Every node is a client of one router, without scouting and shared memory. Only ``zenoh_config``
makes Zenoh configurations. A file given with ``--zenoh-config`` is the base. Its values for
endpoints, scouting, lease, retries and limits are kept, and missing ones are set here; mode and
shared memory are always set here. A value that equals Zenoh's default counts as missing, since
Zenoh fills in its defaults on reading.

The lease is 2 s, after which a frozen node counts as gone. Reconnection is tried every 50 to
200 ms, and an attempt without an answer times out after 0.3 s. Zenoh's own 10 s would not allow
recovery within a second: when a router's container stops, its address disappears, connection
requests are lost, and TCP repeats them only after a second. Every fourth attempt to open a session
gets 1.5 s, for links with long round trips.

Zenoh reconnects a session with the time-outs that it was opened with. So nodes and tools declare
everything on a ``Link``, which tries another session after 10 s without a router and, if that one
connects, declares everything on it and closes the first. That attempt takes up to 1.5 s, for which
an interpreter that ends must wait: otherwise Zenoh would abort the process. ``zv`` and
``run_service`` end at once, without the interpreter's own end.

The router disconnects a client that reads nothing for 1 s. With Zenoh's 5 s, a frozen client would
block all others between the end of its lease and that time. Closing its link then blocks one of
the router's threads for 10 s, so the router has 32 of them instead of two. A message over 128 MiB,
more than the largest raw frame, is never completely in memory: router and nodes close the link on
which it arrives, and the sender connects again. Handlers are declared without Zenoh's queue of 256
in between, so they run on Zenoh's thread and must be quick.
"""
