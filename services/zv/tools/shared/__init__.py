"""Modules that all tools share: sessions, options, output, discovery."""
