"""``zv security``: certificates, and the access rules of routers, for one system.

``roles`` derives the rights of each holder of a certificate from the registry of services, the
topic table and ``keys``. ``router_file`` makes the configuration of a router from them.
``authority`` issues certificates. ``folder`` keeps everything in one folder, whose
``security.json`` lists the holders and has no secrets; each file is replaced as a whole or not at
all. ``commands`` are the commands.
"""
