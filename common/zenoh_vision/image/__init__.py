"""Pictures: pixel formats, JPEG and PNG, and the frame that carries one through the system."""
