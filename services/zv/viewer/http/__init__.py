"""The web server: listening socket, connections, access rules, token, routes and page files."""
