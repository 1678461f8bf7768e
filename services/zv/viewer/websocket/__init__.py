"""The WebSocket of a page: its commands and their limits, its session, and its queue of texts."""
