"""Records what is on the network into files, and accounts for what it missed.

Samples come on Zenoh's threads into a queue that is limited in bytes; one thread writes them, and
another waits for the disk. What the queue or the disk could not take is counted by key and reason.

``Recording`` of ``zv bag record`` and of the service ``recorder`` is ``Recorder`` with a ``Plan``.
"""
