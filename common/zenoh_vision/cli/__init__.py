"""The command line of a program: flags from settings, help, errors, logs and exit status.

``zv`` is made with it, and so is a service of your own. Nothing here loads Zenoh or OpenCV, and
only modules that make flags load the settings.
"""
