"""The command ``zv``: its commands and flags, made from the registries and the settings models."""
