"""PROTOCOL.md and the page's types, generated."""
