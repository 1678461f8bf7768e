"""The viewer: shows every stream in the browser, and serves the streams under URLs."""
