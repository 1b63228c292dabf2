"""Bad lines: emulated channels between network namespaces."""
