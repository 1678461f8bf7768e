"""Streams shared by all clients: subscriptions, pictures in several forms, messages, snapshots."""
