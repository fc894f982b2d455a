"""The stubs of mapping.proto, which the installation generates."""
