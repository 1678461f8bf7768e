"""Records, plays and verifies recordings."""
