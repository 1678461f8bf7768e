"""A node of the system: its lifecycle, its inputs and outputs, the queries that it answers.

Besides Zenoh's threads and the service's loop, a node has two threads: ``queries`` answers queries
one after the other, including changes of parameters, and ``health`` sends the diagnostics once a
second.
"""
