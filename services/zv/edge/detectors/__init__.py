"""Edge detectors: from grey pictures to edge maps, independent of settings."""
