"""Sources of pictures: one module for each kind. They know neither Zenoh nor settings."""
