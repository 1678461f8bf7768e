"""Certificates and rights: who a node is, and what a router lets it do.

``zv security`` writes the files. Those of a node are its *credentials*: one JSON5 file, which is
also a Zenoh configuration, so that a program in any language can load it. It has the certificate,
its private key, the certificate authority's certificate and, as information for error texts, the
rights. What really holds is in the configuration of each router, whose access rules are made from
the same rights: everything that no rule allows is denied.

An action of ``rights`` is one or several kinds of Zenoh's messages, in the direction to the router
and in that from it. ``credentials`` reads a node's file and judges its certificate.
"""
