"""Options of a service: one checked model from flags, environment, TOML and defaults.

A field marked ``Live`` is a parameter: it can change while the node runs.

A node's settings are a frozen object. A change makes a new one, a new revision, so that readers
never see half of a change and need no lock. ``ParameterStore`` has the ``newest`` revision and the
``active`` one, with which the current frame is processed.
"""
