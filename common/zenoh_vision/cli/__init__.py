"""The command line of a program: flags from settings, help, errors, logs and exit status.

Both ``zv`` and services of your own use it. Nothing here loads Zenoh or OpenCV, and only modules
that make flags load the settings.
"""
