"""The camera: reads a source, stamps each frame, publishes the newest."""
