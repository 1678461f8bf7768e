"""The embedded Zenoh router, for machines without zenohd."""
