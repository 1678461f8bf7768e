"""What frames cost as cameras, subscribers and pixels become more."""
