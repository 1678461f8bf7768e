"""The viewer: every stream in the browser, and URLs for them."""
