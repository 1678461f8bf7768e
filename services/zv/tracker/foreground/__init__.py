"""Background subtraction for a fixed camera: learns the background and finds the foreground."""
