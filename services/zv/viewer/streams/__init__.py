"""Streams shared by all clients: subscriptions, rendered pictures, messages, snapshots."""
